"""Candidate tests of a design: their signals, their time, and which of them the rig cannot run; in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from pydantic import Field
from scipy.interpolate import CubicSpline

from mofit.data import Experiment
from mofit.data.signals import smooth_derivative
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import Channel, Model
from mofit.runtime.toml import Strict
from mofit.simulation.virtual_rig.plan import Plan, TestPlan
from mofit.simulation.virtual_rig.setup import set_up
from mofit.units import Quantity, parse_quantity

#: Unit in which what a rig drives is shown, and its factor from SI; others stay in SI.
_SHOWN = {"rad": ("deg", 180 / np.pi), "m": ("mm", 1e3)}
#: Rounding of a grid's values must not push a test over a limit that it is meant to reach.
_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be run."""

    plan: TestPlan
    """As in a plan file."""
    experiment: Experiment
    """Its signals."""
    seconds: float
    """Its duration and the rig's overhead [s]."""
    infeasible: str = ""
    """The limit that it violates; empty if none."""

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.plan.name


class Limits(Strict):
    """What the rig can do at most; what is left out is not limited.

    ``amplitude``, ``rate`` and ``acceleration`` are those of the driven input and its time derivatives (ramps are
    limited by their rate alone), ``outputs`` the largest magnitudes of outputs as the model predicts them.
    """

    amplitude: Quantity | None = None
    rate: Quantity | None = None
    acceleration: Quantity | None = None
    sample_rate: Quantity | None = None
    duration: Quantity | None = None
    outputs: dict[str, Quantity] = Field(default_factory=dict)


@dataclass(frozen=True)
class RigLimits:
    """Largest magnitudes that the rig allows, or that a test requires; infinite where not limited.

    ``channel`` is the driven input, ``amplitude`` in its unit, ``rate`` and ``acceleration`` per s and s²,
    ``sample_rate`` in Hz, ``duration`` in s, ``outputs`` by name.
    """

    channel: str = ""
    amplitude: float = np.inf
    rate: float = np.inf
    acceleration: float = np.inf
    sample_rate: float = np.inf
    duration: float = np.inf
    outputs: Mapping[str, float] = field(default_factory=dict)


def candidates(base: Plan, plans: Sequence[TestPlan], limits: RigLimits, overhead: float) -> tuple[Candidate, ...]:
    """Signals of all tests, and which of them violate a limit of the input (of outputs: later, by simulation).

    Parameters
    ----------
    base
        The plan that the tests would join: model, conditions, and the seed of the phases of multisines (those that
        `mofit simulate` draws are others).
    plans
        The tests.
    limits
        Of the driven input; tests with the input of a calibration stage are limited in sampling rate and duration only.
    overhead
        Time per test beside its duration [s].

    Raises
    ------
    InputError
        With every issue: values of the wrong unit, missing conditions.
    """
    setup = set_up(base.model_copy(update={"tests": tuple(plans)}), "space")
    found = []
    for test in setup.tests:
        # the same phases for every multisine, whatever the other candidates are
        experiment = test.experiment(np.random.default_rng(base.seed), setup.conditions)
        required = required_limits(experiment, test.excited.name)
        broken = violation(required, limits, test.excited.unit)
        found.append(Candidate(test.plan, experiment, required.duration + overhead, broken))
    return tuple(found)


def driven_input(model: Model) -> Channel:
    """The channel that a rig drives."""
    return next(channel for channel in model.inputs if channel.derivative_of is None)


def shown_unit(unit: str) -> tuple[str, float]:
    """The unit in which an SI unit of a driven input is shown, and its factor."""
    return _SHOWN.get(unit, (unit, 1.0))


def declared_limits(limits: Limits, model: Model) -> RigLimits:
    """The limits of a space file in SI units.

    Raises
    ------
    InputError
        With every quantity of the wrong unit, every unknown output and every limit that is not above 0.
    """
    driven = driven_input(model)
    outputs = {channel.name: channel.unit for channel in model.outputs}
    issues = [
        Issue("space, limits.outputs", f"model '{model.name}' has no output '{name}'", did_you_mean(name, outputs))
        for name in limits.outputs
        if name not in outputs
    ]
    units = _units(driven.unit)
    own = {key: _positive(f"space, limits.{key}", getattr(limits, key), units[key], issues) for key in units}
    largest = {
        name: _positive(f"space, limits.outputs.{name}", value, outputs[name], issues)
        for name, value in limits.outputs.items()
        if name in outputs
    }
    raise_errors(issues)
    return RigLimits(driven.name, **own, outputs=largest)


def required_limits(experiment: Experiment, driven: str, measured: bool = False) -> RigLimits:
    """What a test requires of the rig, its outputs aside.

    Accelerations of ramps, which have corners, count as none. ``measured`` inputs are noisy: their derivatives are
    those of a smoothing spline.
    """
    time, values = experiment.time, np.asarray(experiment.inputs[driven], dtype=float)
    if experiment.interpolation != "cubic":
        rate, acceleration = np.diff(values) / np.diff(time), np.zeros(1)
    elif measured:
        _, rate = smooth_derivative(time, values)
        acceleration = np.gradient(rate, time)
    else:
        curve = CubicSpline(time, values)
        rate, acceleration = curve(time, 1), curve(time, 2)
    return RigLimits(
        channel=driven,
        amplitude=float(np.max(np.abs(values))),
        rate=float(np.max(np.abs(rate))),
        acceleration=float(np.max(np.abs(acceleration))),
        sample_rate=1 / experiment.step,
        duration=float(time[-1] - time[0]) + experiment.step,
    )


def demonstrated_limits(tests: Sequence[RigLimits]) -> RigLimits:
    """What a rig has demonstrated: the largest of every requirement. Durations and outputs stay open."""
    return RigLimits(
        channel=tests[0].channel,
        amplitude=max(test.amplitude for test in tests),
        rate=max(test.rate for test in tests),
        acceleration=max((test.acceleration for test in tests if test.acceleration > 0), default=np.inf),
        sample_rate=max(test.sample_rate for test in tests),
    )


def violation(required: RigLimits, limits: RigLimits, unit: str) -> str:
    """The limit of the input that a test violates, in words with numbers; empty if none."""
    units = _units(unit)
    if required.channel != limits.channel:  # a calibration stage's own input
        units = {key: own for key, own in units.items() if key in ("sample_rate", "duration")}
    for key, own in units.items():
        need, allowed = getattr(required, key), getattr(limits, key)
        if need > allowed * (1 + _TOLERANCE):
            return f"{key.replace('_', ' ')}: {need:.3g} {own}, limit {allowed:.3g}"
    return ""


def output_violation(outputs: Mapping[str, float], limits: RigLimits) -> str:
    """The same for the outputs, from their largest magnitudes by name."""
    for name, need in outputs.items():
        if need > limits.outputs.get(name, np.inf) * (1 + _TOLERANCE):
            return f"{name.replace('_', ' ')}: {need:.3g}, limit {limits.outputs[name]:.3g} (SI)"
    return ""


def _units(unit: str) -> dict[str, str]:
    own = {"amplitude": unit, "rate": f"{unit}/s", "acceleration": f"{unit}/s^2"}
    return {**own, "sample_rate": "Hz", "duration": "s"}


def _positive(where: str, value: Quantity | None, unit: str, issues: list[Issue]) -> float:
    if value is None:
        return np.inf
    try:
        number, _ = parse_quantity(where, value, unit)
    except InputError as error:
        issues += error.issues
        return np.inf
    if not number > 0:
        issues.append(Issue(where, f"{value} is not above 0", "Give a positive limit, or leave it out"))
    return number
