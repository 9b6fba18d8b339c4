"""Measured beside simulated signals of each test, and the part of a record that is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.report.run import Mode, Run, numbers
from mofit.report.toolkit.formatting import Unit, display_unit
from mofit.results import Objective

BROADBAND = ("multisine", "chirp", "free")
LOOPS = ("sine", "quasi_static")
"""Excitations of which the output over the input is a loop."""

NINETY = 1.6449
"""Half-width of the 90 % interval of a Gaussian, in standard deviations."""

_BROADBAND_SAMPLES = 400
"""Samples of a broadband test that are drawn; more would be a solid block."""

_FULL = 0.95
"""Share of the usual standard deviation of the input from which a period counts as one at full amplitude."""


@dataclass(frozen=True)
class Overlay:
    """An output of a test: the samples used in the fit, measured and simulated, SI units; empty where a run has none.

    `test` is the name of the test, or ``test / output`` where there are several outputs. `draws` is the output at
    posterior draws, shape (draws, samples), `fireflies` that at fireflies.
    """

    test: str
    excitation: str
    frequency: float
    period: float
    input_name: str
    input_unit: str
    output_name: str
    output_unit: str
    noise_sd: float
    noise_floor: float
    time: FloatArray
    input: FloatArray
    measured: FloatArray
    simulated: FloatArray
    baseline: FloatArray
    draws: FloatArray
    fireflies: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def loops(self) -> bool:
        """Whether its output is drawn over its input."""
        return bool(self.input.size) and self.excitation in LOOPS

    @property
    def middle(self) -> FloatArray:
        """Mean of the draws."""
        return np.asarray(self.draws.mean(axis=0))

    @property
    def parameter_band(self) -> FloatArray:
        """Half of the 90 % band of the model's output: the uncertainty of the parameters alone."""
        return np.asarray(NINETY * self.draws.std(axis=0))

    @property
    def predictive_band(self) -> FloatArray:
        """Half of the 90 % band of a new sample: uncertainty of the parameters and noise of the measurement."""
        return np.asarray(NINETY * np.hypot(self.draws.std(axis=0), self.noise_sd))

    @property
    def quantiles(self) -> FloatArray:
        """5 and 95 % quantile of the model's output over the draws, shape (2, samples); (2, 0) without draws."""
        if not self.draws.size:
            return np.empty((2, 0))
        last = len(self.draws) - 1
        return np.sort(self.draws, axis=0)[[round(0.05 * last), round(0.95 * last)]]

    @property
    def inside(self) -> float:
        """Share of the measured samples within the predictive band; 90 % if the model is right."""
        return float(np.mean(np.abs(self.measured - self.middle) <= self.predictive_band))

    def last(self, periods: int) -> Overlay:
        """The last `periods` periods at full amplitude; of a broadband test a short piece; else all of it."""
        n = self.time.size
        if self.excitation in BROADBAND:
            return self._cut(max(0, n - _BROADBAND_SAMPLES), n)
        if np.isfinite(self.period) and self.period > 0 and n > 1:
            one = round(self.period / float(np.median(np.diff(self.time))))
            end = _last_full(self.input if self.input.size else self.measured, one)
            return self._cut(max(0, end - periods * one - 1), end)
        return self

    def summary(self) -> dict[str, Any]:
        """Its fields with quantiles in place of the draws: what a page keeps of it as JSON."""
        low, high = self.quantiles
        kept = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in ("draws", "fireflies")}
        return kept | {"low": low, "high": high}

    def _cut(self, start: int, end: int) -> Overlay:
        names = ("time", "input", "measured", "simulated", "baseline", "draws", "fireflies")
        return replace(self, **{name: getattr(self, name)[..., start:end] for name in names})


def _last_full(signal: FloatArray, period: int) -> int:
    """Where the last period at full amplitude ends: rigs run out, and the last periods of a record may be smaller."""
    ends = np.arange(signal.size, period - 1, -max(period, 1))
    if ends.size == 0:
        return signal.size
    sizes = np.array([np.std(signal[end - period : end]) for end in ends])
    return int(ends[np.argmax(sizes >= _FULL * np.median(sizes))])


def extract_overlays(run: Run, mode: Mode) -> list[Overlay]:
    """Every test (and output, of several) that the mode predicts, without the samples that the fit left out."""
    if "prediction" not in mode.node.children:
        return []
    predicted = mode.node["prediction"].data_vars
    return [_overlay(run, mode, k, one) for k, one in enumerate(run.objectives) if one.name_of_test in predicted]


def by_output(overlays: Sequence[Overlay]) -> dict[str, list[Overlay]]:
    """The overlays of every output by its name; that of an only output is empty. No test's name holds a ``/``."""
    found: dict[str, list[Overlay]] = {}
    for overlay in overlays:
        found.setdefault(overlay.test.partition(" / ")[2], []).append(overlay)
    return found


def headed(title: str, output: str) -> str:
    """The title of a figure, with the output where there are several."""
    return f"{title}: {output.replace('_', ' ')}" if output else title


def _overlay(run: Run, mode: Mode, index: int, one: Objective) -> Overlay:
    test, observed = one.name_of_test, run.tree["observed_data"].dataset[one.name_of_test]
    name = (one.name_of_output or str(observed.attrs["long_name"])).replace("_", " ")
    unit = observed.attrs["units"] if one.output is None else run.tree.dataset["output_unit"].values[one.output]
    source = run.input_of(test)
    constant = run.tree.children["constant_data"]
    weighted = f"{test}_weight" in constant.data_vars
    used = numbers(constant, f"{test}_weight") > 0 if weighted else np.ones(len(observed), dtype=bool)

    def predicted(node: xr.DataTree | None, group: str = "prediction") -> FloatArray:
        """Simulated output of a group, shape (..., samples used); empty where the group or the test is missing."""
        child = None if node is None else node.children.get(group)
        if child is None or test not in child.data_vars:
            return np.empty(0)
        values = numbers(child, test)
        return (values if one.output is None else values[..., one.output])[..., used]

    measured = np.asarray(observed.values if one.output is None else observed.values[:, one.output], dtype=float)
    draws, fireflies = predicted(mode.node, "posterior_predictive"), predicted(run.group("fireflies"))
    return Overlay(
        test=one.name,
        excitation=run.excitations[one.test],
        frequency=float(run.of_tests("frequency")[one.test]),
        period=float(run.of_tests("period")[one.test]),
        input_name="" if source is None else str(source.name).removeprefix(f"{test}_").replace("_", " "),
        input_unit="1" if source is None else str(source.attrs["units"]),
        output_name="output" if test in name or len(name) > 20 else name,
        output_unit=str(unit),
        noise_sd=float(run.of_objectives("noise_sd")[index]),
        noise_floor=float(run.of_objectives("noise_floor")[index]),
        time=np.asarray(observed[f"time_{test}"].values, dtype=float)[used],
        input=np.empty(0) if source is None else np.asarray(source.values, dtype=float)[used],
        measured=measured[used],
        simulated=predicted(mode.node),
        baseline=predicted(run.group("baseline")),
        draws=draws.reshape(-1, draws.shape[-1]) if draws.size else np.empty((0, 0)),
        fireflies=fireflies if fireflies.size else np.empty((0, 0)),
    )


def output_unit(overlays: Sequence[Overlay]) -> Unit:
    """One display unit for an output of all tests."""
    return display_unit(overlays[0].output_unit, np.concatenate([overlay.measured for overlay in overlays]))
