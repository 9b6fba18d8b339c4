"""Does an FMU give what mofit simulates? Writes reports/fmu_export/README.md.

    python scripts/studies/fmu_export.py [--seed 1] [--work FOLDER]

Every shipped model alone, and the default models of damper and tyre with every shipped effect that they admit, each
with one, are exported as FMUs (FMI 3.0) at parameters drawn around their nominal values: times exp(0.3 z), z standard
normal, within the bounds. FMPy validates the FMU and simulates a record: 400 samples, 2 ms apart, of two sines of 1.4
and 5.9 Hz. The FMU is driven at the samples only, with the derivatives of the cubic spline through them, at its default
tolerance. mofit simulates the same spline with 4096 Runge-Kutta steps per sample; where they are not stable, at its
default tolerance of 1e-6. The deviation is the largest difference of an output as a share of its range; the last column
is that of mofit's default tolerance from the fine steps. Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.models import Model, effect_names, find_effect, find_model, incompatibility, model_names, with_effects
from mofit.models.model import TIME, derivations
from report_page import ROOT, header, made_with, table, write_page

sys.path.insert(0, str(ROOT / "tests" / "support"))
from fmu_runs import drive, fmu_of, record, run, run_of, simulated, validate_fmu

STEP, SAMPLES = 0.002, 400
#: Steps per sample of the reference.
FINE = 4096
#: Angular frequencies, and the share of the amplitude that each has.
LINES = ((9.0, 1.0), (37.0, 0.3))
#: Amplitudes of what is measured.
AMPLITUDES = {"slip_angle": 0.05, "displacement": 0.01, "lateral_displacement": 0.01, "force": 1.0}
CONDITIONS = {
    "longitudinal_velocity": 60 / 3.6, "vertical_force": 3600.0, "dynamic_rolling_radius": 0.31, "wheel_phase": 0.4,
    "drum_radius": 0.85, "drum_phase": 1.1, "camber_angle": 0.02, "start_time": 30.0, "averaging_time": 0.01,
    "sample_interval": STEP, "record_length": STEP * (SAMPLES - 1),
}  # fmt: skip


def inputs_of(model: Model) -> list[FloatArray]:
    """Samples of all inputs but time, derivatives exact."""
    found, clock = [], STEP * np.arange(SAMPLES)
    for source, order in derivations(model.inputs).values():
        if source != TIME.name:
            parts = (a * w**order * np.sin(w * clock + order * np.pi / 2) for w, a in LINES)
            found.append(AMPLITUDES[source] * sum(parts, np.zeros(SAMPLES)))
    return found


def row(base: str, effect: str, seed: int) -> dict[str, object]:
    """What comes of a model with an effect; without one if that is empty."""
    model = with_effects(find_model(base), *([find_effect(effect)] if effect else []))
    rng = np.random.default_rng([seed, *f"{base}+{effect}".encode()])
    values = {
        p.name: float(np.clip(p.nominal * np.exp(0.3 * rng.standard_normal()), p.lower, p.upper))
        for p in model.parameters
    }
    conditions = {c.name: CONDITIONS.get(c.name, c.default) for c in model.conditions}
    test = record(model, inputs_of(model), STEP, list(conditions.values()))
    tree = run_of(model, values, {name: [value] for name, value in conditions.items()}, {"drive": test})
    usual, wanted = simulated(model, test, values), simulated(model, test, values, steps=FINE)
    if not np.isfinite(wanted).all():
        wanted = usual
    with tempfile.TemporaryDirectory() as folder:
        path = fmu_of(tree, model, Path(folder))
        problems = validate_fmu(str(path))
        begin = time.perf_counter()
        found = run(path, drive(tree, model, test), STEP)
        seconds = time.perf_counter() - begin
    deviation, own = (float(np.max(np.abs(one - wanted)) / np.ptp(wanted)) for one in (found, usual))
    return {
        "states": len(model.states), "problems": len(problems), "deviation": deviation, "usual": own,
        "seconds": round(seconds, 3),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "fmu_export")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    kept = options.work / f"rows_{options.seed}.json"
    rows = json.loads(kept.read_text()) if kept.exists() else {}
    lines, used = [], list[str]()
    for base in model_names():
        model = find_model(base)
        admitted = [name for name in effect_names() if incompatibility(find_effect(name), model) is None]
        effects = admitted if model.default else []
        for effect in ("", *effects):
            if (key := f"{base}+{effect}") not in rows:
                rows[key] = row(base, effect, options.seed)
                kept.write_text(json.dumps(rows))
        used += [f"{base}+{effect}" for effect in ("", *effects)]
        own = {effect: rows[f"{base}+{effect}"] for effect in ("", *effects)}
        deviations = {effect or "alone": one["deviation"] for effect, one in own.items()}
        worst = max(deviations, key=lambda name: deviations[name])
        counts = [one["states"] for one in own.values()]
        states = " to ".join(map(str, sorted({min(counts), max(counts)})))
        lines.append(
            (
                base, len(own), states, sum(one["problems"] for one in own.values()),
                f"{deviations['alone']:.1e}", f"{np.median(list(deviations.values())):.1e}",
                f"{deviations[worst]:.1e} ({worst.replace('_', ' ')})",
                f"{max(one['seconds'] for one in own.values()):.2f}",
                f"{max(one['usual'] for one in own.values()):.1e}",
            )
        )  # fmt: skip
    shown = [rows[key] for key in used]
    within = sum(one["deviation"] < 1e-6 for one in shown)
    columns = (
        "model", "FMUs", "states", "problems by validation", "deviation, alone", "median", "largest",
        "longest simulation, s", "largest of the default tolerance",
    )  # fmt: skip
    page = header("FMUs beside mofit's simulation", __doc__, f"fmu_export.py --seed {options.seed}", made_with("fmpy"))
    page += [
        f"{within} of {len(shown)} FMUs deviate by less than 1e-6 of the range.",
        "",
        *table(columns, lines),
    ]
    page += ["The longest simulation is one of 0.8 s, with unpacking and loading.", ""]
    write_page("fmu_export", page)


if __name__ == "__main__":
    main()
