"""The model's parameters fitted as `mofit.diagnose` does without effects; signals for the peers. Runs as a process.

python baseline.py NAME --work FOLDER --model MODEL --seed 0
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from diagnosis_peers_cases.records import Records, forces, rms, save
from mofit import Campaign, read_campaign
from mofit._typing import FloatArray
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.identification.settings import Settings
from mofit.models import Equations, Model, find_model
from mofit.parameters import ParameterSpace
from mofit.problem import build_problem

#: size of the added force, relative to the input's root mean square: the models are linear, it need only be small
SMALL = 1e-2
#: change of a parameter's unit coordinate
CHANGE = 1e-3
#: state that effects of a stiffness act on, of the models whose output is a rate
DEFLECTIONS = {"joint": "twist"}
#: model whose input is the motion and whose output is the force
FORCE_OUT = "kelvin_voigt_damper"


@dataclass(frozen=True)
class Simulator:
    """The model at the fitted parameters."""

    model: Model
    space: ParameterSpace
    point: FloatArray

    def outputs(self, records: Campaign, points: FloatArray) -> FloatArray:
        """Output at unit coordinates (points, parameters) of every test, (points, tests, samples)."""
        simulated = build_problem(self.model, records, space=self.space).simulate(points)
        return np.stack([one[:, :, 0] for one in simulated], axis=1)

    def output(self, records: Campaign) -> FloatArray:
        """Output of every test, (tests, samples)."""
        return np.asarray(self.outputs(records, self.point[None])[0])

    def moved(self, records: Campaign) -> FloatArray:
        """Change of the output by each parameter, (parameters, tests, samples), per unit coordinate."""
        steps = np.where(self.point > 0.5, -CHANGE, CHANGE)
        still, *others = self.outputs(records, np.vstack([self.point, self.point + np.diag(steps)]))
        return np.stack([(other - still) / step for other, step in zip(others, steps, strict=True)])


def watching(model: Model, state: str) -> Model:
    """The model with a state in place of its output."""

    def equations(self: Model, s: object) -> Equations:
        found = model.equations(s)  # type: ignore[arg-type]
        return replace(found, outputs={model.outputs[0].name: getattr(s, state)})

    found: Model = type("Watching", (type(model),), {"equations": equations})()
    return found


def driven(simulator: Simulator, records: Campaign, added: FloatArray, unit: float) -> FloatArray:
    """Change of the output by forces (terms, tests, samples) beside the input, in units of the input."""
    channel, tests = simulator.model.inputs[0].name, []
    size = SMALL * unit
    for k, per_test in enumerate(added):
        for one, force in zip(records.measurements, per_test, strict=True):
            pushed = {channel: one.experiment.inputs[channel] + size * force}
            tests.append(replace(one, experiment=replace(one.experiment, name=f"{one.name}_{k}", inputs=pushed)))
    changed = simulator.output(replace(records, measurements=tuple(tests))).reshape(added.shape)
    return np.asarray((changed - simulator.output(records)) / SMALL)


def inputs(model: Model, records: Campaign) -> FloatArray:
    """The input of every test, (tests, samples)."""
    return np.stack([one.experiment.inputs[model.inputs[0].name] for one in records.measurements])


def fitted(model: Model, campaign: Campaign, seed: int) -> Simulator:
    """The model with its parameters fitted, as a diagnosis does it without effects."""
    names = tuple(one.name for one in campaign.measurements)
    found, _ = baseline_in_wide_ranges(model, campaign, Settings(seed=seed, jobs=1), names)
    return Simulator(model, found.hypothesis.space, found.minimum.point)


def prepared(simulator: Simulator, campaign: Campaign, held: Campaign) -> tuple[dict[str, Records], FloatArray, float]:
    """Signals of campaign and records held out; the simulated outputs of these and the residual's size in SI units."""
    model = simulator.model
    motions = [_motion(simulator, records) for records in (campaign, held)]
    scales = [rms(signal) for signal in motions[0]]
    measured = np.stack([one.outputs[model.outputs[0].name] for one in campaign.measurements])
    residual = measured - motions[0][1]
    parts = {}
    for part, records, motion in zip(("campaign", "held_out"), (campaign, held), motions, strict=True):
        u, s, x, v = (signal / scale for signal, scale in zip(motion, scales, strict=True))
        is_force = model.name == FORCE_OUT
        forced = np.empty((0, 0, 0)) if is_force else driven(simulator, records, forces(u, x, v), scales[0]) / scales[1]
        left = residual / rms(residual) if part == "campaign" else np.empty((0, 0))
        parts[part] = Records(u, s, x, v, forced, simulator.moved(records) / scales[1], left)
    return parts, motions[1][1], rms(residual)


def _motion(simulator: Simulator, records: Campaign) -> list[FloatArray]:
    """Input, simulated output, deflection and rate."""
    model = simulator.model
    u, s = inputs(model, records), simulator.output(records)
    step = records.measurements[0].experiment.step
    if model.name == FORCE_OUT:
        return [u, s, u, np.gradient(u, step, axis=1)]
    if state := DEFLECTIONS.get(model.name):
        return [u, s, replace(simulator, model=watching(model, state)).output(records), s]
    return [u, s, s, np.gradient(s, step, axis=1)]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--model", required=True)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    campaign, held = (read_campaign(args.work / part / f"{args.name}.nc") for part in ("campaigns", "held_out"))
    simulator = fitted(find_model(args.model), campaign, args.seed)
    began = time.process_time()
    parts, simulation, scale = prepared(simulator, campaign, held)
    print(json.dumps({"columns": time.process_time() - began}))
    folder = args.work / "peers" / args.name
    save(folder / "records.npz", parts)
    names = [one.name for one in held.measurements]
    np.savez_compressed(folder / "simulated.npz", scale=scale, **dict(zip(names, simulation, strict=True)))


if __name__ == "__main__":
    main()
