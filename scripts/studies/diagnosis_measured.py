"""Diagnose measured data with incomplete models. Writes reports/diagnosis_measured/README.md.

    python scripts/studies/diagnosis_measured.py [--data FOLDER] [--work FOLDER] [--seed 0]

Damper: six sine tests of a magneto-rheological damper per coil current, spring and damper in parallel. Friction: sine
strokes of a friction damper with play; an earthquake is held out. Battery: current pulses on a cell at nine charge
states, a series resistance alone. Tanks: two, one below the other, which overflow, without that. EMPS: position in,
motor force out; inertia, viscous friction and an offset. Silverbox: a linear oscillator on the ten multisines, then
pure simulation of the arrow, which no fit has seen. DMA: storage and loss modulus of a polymer at ten frequencies and
21 temperatures; one spring and one Maxwell branch. Table 4: do the estimates per frequency that Hackl et al. 2016 print
agree with one another? There is no raw data of them. Sections that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.stats import f as fisher

from diagnosis_measured_records import cell, overflow
from mofit._typing import FloatArray
from mofit.data import import_files
from mofit.data.campaign import Measurement
from mofit.data.dma import sine_tests
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.result import Diagnosis
from mofit.identification.settings import Settings
from mofit.models import find_effect, find_model, with_effects
from mofit.problem import build_problem
from mofit.results import cochran
from mofit.runtime.parallel import end_with_parent
from paper_tables import TABLE_4
from report_page import ROOT, header, made_with, write_page

#: SOURCE.txt of the EMPS data: mass [kg], viscous friction [N s/m], dry friction [N], offset [N]
EMPS = {"m_b": 95.0, "d": 201.6, "F_d": 20.6, "F_0": -3.24}


def reported(found: Diagnosis) -> list[str]:
    """What a diagnosis reports, as Markdown."""
    lines = [f"**{found.conclusion.sentence}** (verdict: {found.conclusion.verdict}; {found.seconds:.0f} s)", ""]
    lines += ["| effect | probability | size | 90 % interval | parameters |", "|---|---|---|---|---|"]
    for effect in found.conclusion.effects:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in effect.parameters.items())
        interval = f"{effect.size_low:.4g} to {effect.size_high:.4g}"
        lines.append(
            f"| {effect.title} | {effect.probability:.3f} | {effect.size:.4g} {effect.unit} | {interval} | {values} |"
        )
    lines += ["", "| test | NRMSD before % | after % | noise floor % |", "|---|---|---|---|"]
    for test, before in found.nrmsd_before.items():
        after, floor = found.nrmsd_after[test], found.noise_floor[test]
        lines.append(f"| {test} | {100 * before:.2f} | {100 * after:.2f} | {100 * floor:.2f} |")
    shrinkage = found.shrinkage
    lines.append("")
    if shrinkage is None:
        lines.append(f"Shrinkage on tests left out: not reported, {found.shrinkage_reason}.")
    else:
        lines += [
            "| left out of the fit | share of the gap removed | 90 % interval | on the raw data |",
            "|---|---|---|---|",
        ]
        for one in shrinkage.shares:
            interval = f"{one.low:.3f} to {one.high:.3f}"
            lines.append(f"| {one.place} | {one.share:.3f} | {interval} | {one.observed:.3f} |")
        lines += ["", " ".join(filter(None, (shrinkage.sentence, shrinkage.caveat)))]
    return [*lines, ""]


def damper(data: Path, seed: int) -> list[str]:
    """Spring and damper in parallel on both coil currents."""
    lines = []
    for key, current in (("0A", "0 A"), ("0x5A", "0.5 A")):
        campaign = import_files([data / "mr_damper_sine"], ROOT / "data" / "maps" / f"mr_damper_{key}.toml")
        found = diagnose(campaign, find_model("kelvin_voigt_damper"), (), Settings(seed=seed, jobs=1))
        lines += [f"## Magneto-rheological damper, {current}", "", *reported(found)]
    return lines


def friction(data: Path, seed: int) -> list[str]:
    """Spring and damper in parallel on sine strokes, judged on an earthquake that no fit has seen."""
    campaign = import_files([data / "friction_damper"], ROOT / "data" / "maps" / "friction_damper.toml")
    settings = Settings(seed=seed, jobs=1)
    found = diagnose(campaign, find_model("kelvin_voigt_damper"), (), settings, hold_out="earthquake")
    return ["## Friction damper with play", "", *reported(found)]


def emps(data: Path, seed: int) -> list[str]:
    """Inertia, viscous friction and offset of a positioning system."""
    campaign = import_files([data / "emps"], ROOT / "data" / "maps" / "emps.toml")
    model = with_effects(find_model("kelvin_voigt_damper"), find_effect("inertia"))
    settings = Settings(seed=seed, jobs=1, fixed={"c": 0.0, "p": 0.0}, bounds={"m_b": (0.0, 300.0)})
    found = diagnose(campaign, model, (), settings, tests=("trajectory",))
    lines = ["## Electro-mechanical positioning system", "", *reported(found)]
    # what is named becomes part of the model, and the next look is finer
    named = with_effects(model, *(effect for effect in found.attribution.best.fitted.hypothesis.effects))
    again = diagnose(campaign, named, (), settings, tests=("trajectory",))
    lines += ["With the named effect as part of the model:", "", *reported(again)]
    lines += ["| parameter | without | with the named effect | 90 % interval | SOURCE.txt |", "|---|---|---|---|---|"]
    without, best = found.attribution.baseline, found.attribution.best.fitted
    values, space = best.values, best.hypothesis.space
    half = 1.645 * best.sd() * best.derivative
    for name, known in EMPS.items():
        cells = [_beside(fitted.values, name, known) for fitted in (without, best)]
        reach = half[space.index(name)]
        cells.append(f"{values[name] - reach:.4g} to {values[name] + reach:.4g}")
        lines.append(f"| {name} | {' | '.join(cells)} | {known:g} |")
    lines += ["", EMPS_READING, "", f"| least squares | {' | '.join(EMPS)} |", "|---|---|---|---|---|"]
    test = campaign["trajectory"]
    run = round(6.24 / test.experiment.step)
    parts = {"whole record": slice(None), **{f"run {i + 1}": slice(i * run, (i + 1) * run) for i in range(4)}}
    rows = {name: least_squares(test, part, 0.0) for name, part in parts.items()}
    rows["whole record, without samples below 5 mm/s"] = least_squares(test, slice(None), 5e-3)
    lines += [f"| {name} | {' | '.join(f'{value:.4g}' for value in row)} |" for name, row in rows.items()]
    return [*lines, ""]


EMPS_READING = (
    "The second look adds nothing to the table: no known effect is accepted for what is left. For comparison, plain "
    "least squares of the force on acceleration, velocity, its sign and a constant, by central differences: how much "
    "depends on the samples used, and how the runs differ."
)


def least_squares(test: Measurement, part: slice, slowest: float) -> FloatArray:
    """Mass, viscous and dry friction and offset from some samples of a test that move faster than ``slowest`` [m/s]."""
    velocity = np.gradient(test.channel("displacement"), test.experiment.step)
    acceleration = np.gradient(velocity, test.experiment.step)
    design = np.column_stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)])[part]
    fast = np.abs(velocity[part]) >= slowest
    return np.asarray(np.linalg.lstsq(design[fast], test.channel("force")[part][fast], rcond=None)[0])


def _beside(values: Mapping[str, float], name: str, known: float) -> str:
    """A value and how far it is from the known one."""
    if name not in values:
        return ""
    return f"{values[name]:.4g} ({100 * (values[name] / known - 1):+.1f} %)"


def silverbox(data: Path, seed: int) -> list[str]:
    """A linear oscillator on the multisines, judged on the arrow."""
    campaign = import_files([data / "silverbox"], ROOT / "data" / "maps" / "silverbox.toml")
    multisines = tuple(m.name for m in campaign.measurements if m.name.startswith("multisine"))
    linear = find_model("oscillator")
    found = diagnose(campaign, linear, (), Settings(seed=seed, jobs=1), tests=multisines)
    lines = ["## Silverbox", "", *reported(found), "| model | error on the arrow, mV rms |", "|---|---|"]
    for fitted in (found.attribution.baseline, found.attribution.best.fitted):
        effects = fitted.hypothesis.effects
        problem = build_problem(with_effects(linear, *effects), campaign.select(["arrow"]))
        point = problem.space.to_unit([fitted.values[name] for name in problem.space.names])
        error = 1e3 * (problem.simulate(point[None])[0][0, :, 0] - problem.measurements[0].channel("displacement"))
        rms = np.sqrt(np.mean(error[problem.experiments[0].weights[:, 0] > 0] ** 2))
        lines.append(f"| {' with '.join(['linear', *(effect.title for effect in effects)])} | {rms:.2f} |")
    return [*lines, ""]


#: N/m per MPa: a bar with A / l = 1e-5 m
PER_MPA = 10.0
#: scatter of E' and E'', see SOURCE.txt
SCATTER = 0.004, 0.047
#: effects that are further relaxation times
RELAXATION = {"second_branch", "springpot"}
RECONSTITUTED = (
    "Reconstituted: of each frequency the data hold E' and E'' alone. `mofit.data.dma` turns them into the force "
    "of a bar with A / l = 10⁻⁵ m (1 MPa is 10 N/m) under a sine of X = 1 mm: two periods of growth, then four "
    "steady ones of 96 samples with the force X (k' sin ωt + k'' cos ωt) and white noise. The fit uses the steady "
    "periods alone. The noise is such that a modulus found from them scatters by the larger of 0.4 % of E' and "
    "4.7 % of E'', the scatter that SOURCE.txt states. No noise is added at the frequency itself, because the "
    "measured moduli carry theirs. Harmonics and repetitions are not in the data; the records hold noise there. "
    "Effects that show in harmonics (friction, backlash, non-linear stiffness) cannot be seen and are not tried. "
    "The ten frequencies of one temperature are one campaign; the model is a spring beside one Maxwell branch."
)
#: what moduli can tell
LINEAR = ("second_branch", "springpot", "delay", "sensor_lowpass", "inertia", "force_gain")


@dataclass(frozen=True)
class Temperature:
    """What the moduli of one temperature said: a row of the table, and the whole of it."""

    row: str
    further: str
    rejected: bool
    loss: float
    celsius: int
    report: list[str]


def temperature(moduli: FloatArray, seed: int) -> Temperature:
    """One relaxation time against moduli (n, 4): frequency, E', E'', temperature."""
    f, storage, loss, celsius = moduli.T
    spread = np.maximum(SCATTER[0] * storage, SCATTER[1] * loss)
    campaign = sine_tests(f, *(PER_MPA * part for part in (storage, loss, spread)), seed=seed)
    # the standard linear solid: a spring beside one Maxwell branch
    settings = Settings(seed=seed, jobs=1, fixed={"d": 0.0, "p": 0.0, "F_0": 0.0}, bounds={"c": (0.0, 1e5)})
    found = diagnose(campaign, find_model("maxwell_damper"), LINEAR, settings)
    further = "no"
    if RELAXATION & set(found.attribution.best.effects):
        further = "nearest" if found.conclusion.verdict == "unknown" else "named"
    values, tan, degrees = found.attribution.best.fitted.values, loss / storage, round(float(celsius.mean()))
    times = [values["d_M"] / values["c_M"], *([values["tau_2"]] if "tau_2" in values else [])]
    cells = (
        degrees,
        f"{storage.min():.0f} to {storage.max():.0f}",
        f"{tan.min():.3f} to {tan.max():.3f}",
        further,
        found.conclusion.sentence,
        ", ".join(f"{time:.2g}" for time in times),
        f"{values['a_f']:.2f}" if "a_f" in values else "",
    )
    row = f"| {' | '.join(map(str, cells))} |"
    return Temperature(
        row, further, found.attribution.baseline_residuals.p_value < 1e-3, float(tan.max()), degrees, reported(found)
    )


def dma(data: Path, seed: int) -> list[str]:
    """One relaxation time against the dynamic moduli of every temperature, on both cores."""
    columns = np.genfromtxt(data / "nrel_dma" / "freq_user_raw.csv", delimiter=",", skip_header=2)
    parts = [columns[columns[:, 4] == number, :4] for number in np.unique(columns[:, 4])]
    found: list[Temperature] = []
    # a process keeps what it compiled; after some temperatures that fills the memory
    for start in range(0, len(parts), 6):
        with ProcessPoolExecutor(2, get_context("spawn"), initializer=end_with_parent) as pool:
            found += pool.map(partial(temperature, seed=seed), parts[start : start + 6])
    lossy = max(found, key=lambda one: one.loss)
    said = [one.further for one in found]
    return [
        "## Dynamic-mechanical analysis of a polymer",
        "",
        RECONSTITUTED,
        "",
        f"**One relaxation time is rejected (p < 0.001) at {sum(one.rejected for one in found)} of {len(found)} "
        "temperatures. More than one is "
        f"named at {said.count('named')}, and at {said.count('nearest')} part of the nearest "
        "explanation, which leaves more than noise.**",
        "",
        "| °C | E' MPa | tan δ | further relaxation time | conclusion | relaxation times s | springpot's exponent |",
        "|---|---|---|---|---|---|---|",
        *(one.row for one in found),
        "",
        f"At {lossy.celsius} °C, where the loss is largest:",
        "",
        *lossy.report,
    ]


def table_4(data: Path, seed: int) -> list[str]:
    """Cochran's test of the printed estimates, the scatter of the three minima of a frequency being their spread."""
    lines = [
        "## Table 4 of Hackl et al. 2016",
        "",
        "27 rows as printed, three local minima for each of nine frequencies. Standard deviation: of a frequency's "
        "three minima, pooled over the frequencies, of the mean of three. If the model were right, the means of "
        "the nine frequencies would agree; p by F, as that standard deviation is estimated (one-way analysis of "
        "variance).",
        "",
        "| parameter | mean | 0.25 Hz | 4 Hz | Cochran's Q (8 degrees of freedom) | p | I² | trend per octave |",
        "|---|---|---|---|---|---|---|---|",
    ]
    values = np.array(list(TABLE_4.values()), dtype=np.float64)
    octaves = np.log2(list(TABLE_4))
    means = values.mean(axis=1)
    sds = np.sqrt(values.var(axis=1, ddof=1).mean(axis=0) / values.shape[1])
    for k, (name, unit) in enumerate((("d_y", "N s/m"), ("c_M", "N/m"), ("d_M", "N s/m"))):
        mean, _, q, _, i_squared = cochran(means[:, k], np.full(len(means), sds[k]))
        between, within = len(means) - 1, values[..., k].size - len(means)
        p = float(fisher.sf(q / between, between, within))
        slope = np.polyfit(octaves, means[:, k], 1)[0]
        error = sds[k] / np.sqrt(np.sum((octaves - octaves.mean()) ** 2))
        lines.append(
            f"| {name} | {mean:.0f} {unit} | {means[0, k]:.0f} | {means[-1, k]:.0f} | {q:.1f} | {p:.1g} | "
            f"{i_squared:.2f} | {slope:+.0f} ± {error:.0f} {unit} |"
        )
    return [*lines, "", READING, ""]


READING = (
    "Reading: the Maxwell stiffness agrees over the frequencies, both dampers do not; they fall with frequency. One "
    "relaxation time does not hold from 0.25 to 4 Hz, so the printed numbers alone show a gap: rate-dependent, in the "
    "part in quadrature. Which effect causes it (a further relaxation time, a lag of the patch or of the transducer, "
    "dry friction) the numbers cannot tell; raw data can."
)
STUDIES = {
    "damper": damper,
    "friction": friction,
    "cell": partial(cell, reported=reported),
    "overflow": partial(overflow, reported=reported),
    "emps": emps,
    "silverbox": silverbox,
    "dma": dma,
    "table_4": table_4,
}


def main() -> None:
    """Diagnose, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "diagnosis_measured")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    lines = header("Diagnosis of measured data", __doc__, f"diagnosis_measured.py --seed {options.seed}", made_with())
    for name, study in STUDIES.items():
        kept = options.work / f"{name}-{options.seed}.md"
        if not kept.exists():
            kept.write_text("\n".join(study(options.data, options.seed)), encoding="utf-8")
        lines += [*kept.read_text(encoding="utf-8").rstrip().splitlines(), ""]
    write_page("diagnosis_measured", lines)


if __name__ == "__main__":
    main()
