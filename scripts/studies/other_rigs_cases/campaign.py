"""A campaign, its model file and its label: drawn, simulated, written. The label is for the scorer alone."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from mofit import Campaign, Experiment, Measurement, write_campaign
from mofit._typing import FloatArray
from other_rigs_cases.cases import CASES, RIGS, Case, Cell
from other_rigs_cases.excitation import COUNT, SAMPLE, Test, held_out, planned
from other_rigs_cases.noise import noise
from other_rigs_cases.rig import Rig, Units
from other_rigs_cases.sensor import ROTATION
from other_rigs_cases.strength import STRONG, WEAK, Specimen, Strength, strengthened
from other_rigs_cases.tyre import SLOW_COUNT, SLOW_STEP, SPEED, STROKE, stroke


def name_of(cell: Cell, seed: int) -> str:
    """A name that tells nothing."""
    return hashlib.sha256(json.dumps([cell.numbers, seed]).encode()).hexdigest()[:10]


def make(cell: Cell, seed: int, folder: Path) -> str:
    """Write campaign, records held out, model and label; returns the model as ``diagnose`` takes it."""
    rig, case, name = RIGS[cell.rig], CASES[cell.case], name_of(cell, seed)
    rng = np.random.default_rng([seed, *cell.numbers])
    values, units = rig.draw(rng), rig.units(rng)
    settled = cell.excitation in ("sine", "multisine") and bool(rng.integers(2))
    tests = planned(rng, cell.excitation, rig.rolling, settled, rig.periods)
    specimen = Specimen(rig, values, tests)
    target = WEAK * (STRONG / WEAK) ** rng.random()
    strong = strengthened(specimen, case, target, seed) if case.knob else Strength(0.0, specimen.level, 0.0)
    knobs = {case.knob: strong.size} if case.knob else {}
    unseen = held_out(rng, cell.excitation, settled, rig.periods)
    unseen = [replace(test, start=rng.uniform(0, specimen.reach.duration)) for test in unseen]
    clean = specimen.records(knobs, [*tests, *unseen], np.random.default_rng(seed))
    coloured = np.stack([noise(rng, cell.noise, COUNT) for _ in range(clean.shape[1])], axis=1)
    noisy = (clean + strong.noise * coloured) * units.output
    stated = case.kind != "no encoder" and (case.effect == "wheel_order" or bool(rng.integers(2)))
    speed = rotational_speed(units) if not rig.rolling and (stated or case.kind == "no encoder") else {}
    measured = [_measurement(rig, units, t, noisy[:, k], stated, speed) for k, t in enumerate([*tests, *unseen])]
    if rig.rolling:
        still = specimen.standing(knobs, values) + strong.noise * noise(rng, cell.noise, SLOW_COUNT)
        measured.insert(len(tests), _standing(still))
    seen, count = measured[: -len(unseen)], len(tests)
    parts = {"campaigns": seen, "held_out": measured[-len(unseen) : -1], "given": measured[-1:]}
    for part, records in parts.items():
        _write(rig, records, folder / part / f"{name}.nc")
    model = rig.model or _model_file(
        rig, rig.source(values, units, rng) if rig.source else "", folder / "models" / name
    )
    label = _label(cell, case, strong, target, seed) | {"begins": "settled" if settled else "at rest"}
    truth = {test.name: clean[:, count + k] * units.output for k, test in enumerate(unseen)}
    (folder / "labels").mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / "labels" / f"{name}.npz", label=json.dumps(label), **truth)
    return model


def _label(cell: Cell, case: Case, strong: Strength, target: float, seed: int) -> dict[str, object]:
    about = {key: value for key, value in asdict(case).items() if key not in ("rigs", "excitations")}
    ratio = strong.gap / strong.noise
    return {
        **about, "case": case.name, "rig": cell.rig, "excitation": cell.excitation, "noise": cell.noise, "seed": seed,
        "repeat": cell.repeat, "size": strong.size, "target": target, "gap_over_noise": ratio,
        "visible": strong.visible or not case.knob,
    }  # fmt: skip


def rotational_speed(units: Units) -> dict[str, float]:
    """Condition of a rig on which a part rotates: its speed, as a nameplate states it, to three digits."""
    return {"rotational_speed": float(f"{ROTATION / units.time:.3g}")}


def _measurement(
    rig: Rig, units: Units, test: Test, output: FloatArray, stated: bool, speed: Mapping[str, float]
) -> Measurement:
    time = np.arange(COUNT) * SAMPLE
    conditions = {"longitudinal_velocity": SPEED * test.speed} if rig.rolling else {**speed}
    if rig.rolling and stated:
        conditions |= {"wheel_phase": test.angle, "drum_phase": test.angle}
    experiment = Experiment(
        test.name,
        test.kind,
        time * units.time,
        {rig.input[0]: test.drive(time)[0] * units.input},
        conditions,
        test.frequencies[0] / (2 * np.pi * units.time) if test.kind == "sine" else None,
        test.amplitude * units.input,
        None if test.kind == "step" else test.start * units.time,
    )
    return Measurement(experiment, {rig.output[0]: output}, dict([rig.input, rig.output]))


def _standing(force: FloatArray) -> Measurement:
    """The quasi-static test of a tyre."""
    time, inputs = np.arange(SLOW_COUNT) * SLOW_STEP, {"lateral_displacement": stroke()}
    experiment = Experiment("quasi_static", "quasi_static", time, inputs, {}, amplitude=STROKE, interpolation="linear")
    return Measurement(experiment, {"lateral_force": force}, {"lateral_displacement": "m", "lateral_force": "N"})


def _write(rig: Rig, records: Sequence[Measurement], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    conditions = {key: value for key, (value, _) in rig.conditions.items()}
    write_campaign(Campaign(rig.title, "simulated", conditions, tuple(records)), path)


def _model_file(rig: Rig, source: str, path: Path) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    file = path.with_suffix(".py")
    file.write_text(source, encoding="utf-8")
    return f"{file}:{rig.name.capitalize()}"
