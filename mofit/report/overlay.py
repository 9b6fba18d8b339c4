"""Measured beside simulated: what both are, test by test, and the part of the record that is worth drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.report.display import Unit, display_unit
from mofit.report.loops import loops_figure
from mofit.report.page import Block, Section, Text
from mofit.report.run import SHOWN, Array, Cluster, Run, numbers
from mofit.report.spectrum import extract_spectra, spectra_figure
from mofit.report.time_traces import traces_figure

BROADBAND = ("multisine", "chirp", "free")
_TRACE_SAMPLES = 400
"""Samples of a broadband test that are shown; more would be a solid block."""

_FULL = 0.95
"""Share of the usual standard deviation of the input from which a period counts as one at full amplitude."""


@dataclass(frozen=True)
class Overlay:
    """One test: the samples that counted, measured and simulated, SI units; empty arrays where a run has none."""

    test: str
    kind: str
    period: float
    input_name: str
    input_unit: str
    output_name: str
    output_unit: str
    noise_sd: float
    time: Array
    input: Array
    measured: Array
    simulated: Array
    baseline: Array
    low: Array
    high: Array

    def last(self, periods: int) -> Overlay:
        """The last `periods` periods at full amplitude; of a broadband test a short piece; else all of it."""
        n = self.time.size
        if self.kind in BROADBAND:
            return self._cut(max(0, n - _TRACE_SAMPLES), n)
        if np.isfinite(self.period) and self.period > 0 and n > 1:
            one = round(self.period / float(np.median(np.diff(self.time))))
            end = _last_full(self.input if self.input.size else self.measured, one)
            return self._cut(max(0, end - periods * one - 1), end)
        return self

    def _cut(self, start: int, end: int) -> Overlay:
        names = ("time", "input", "measured", "simulated", "baseline", "low", "high")
        return replace(self, **{name: getattr(self, name)[start:end] for name in names})


def _last_full(signal: Array, period: int) -> int:
    """Where the last period at full amplitude ends: rigs run out, and the last periods of a record may be smaller."""
    ends = np.arange(signal.size, period - 1, -max(period, 1))
    if ends.size == 0:
        return signal.size
    sizes = np.array([np.std(signal[end - period : end]) for end in ends])
    return int(ends[np.argmax(sizes >= _FULL * np.median(sizes))])


def extract_overlays(run: Run, cluster: Cluster) -> list[Overlay]:
    """Every test that the cluster predicts, without the samples that were dropped."""
    if "prediction" not in cluster.node.children:
        return []
    predicted = cluster.node.children["prediction"].data_vars
    return [_overlay(run, cluster, k, test) for k, test in enumerate(run.tests) if test in predicted]


def judged(run: Run, test: str) -> NDArray[np.bool_]:
    """Which samples of a test counted."""
    constant = run.tree.children["constant_data"]
    if f"{test}_weight" in constant.data_vars:
        return np.asarray(numbers(constant, f"{test}_weight") > 0)
    return np.ones(run.tree.children["observed_data"].dataset[test].size, dtype=bool)


def _overlay(run: Run, cluster: Cluster, index: int, test: str) -> Overlay:
    observed = run.tree.children["observed_data"].dataset[test]
    name = str(observed.attrs["long_name"]).replace("_", " ")
    driver = run.input_of(test)
    kept = judged(run, test)
    low, high = _band(cluster, test)
    return Overlay(
        test=test,
        kind=run.kinds[index],
        period=float(run.of_tests("period")[index]),
        input_name=str(driver.name).removeprefix(f"{test}_").replace("_", " ") if driver is not None else "",
        input_unit=str(driver.attrs["units"]) if driver is not None else "1",
        output_name="output" if test in name or len(name) > 20 else name,
        output_unit=str(observed.attrs["units"]),
        noise_sd=float(run.of_tests("noise_sd")[index]),
        time=np.asarray(observed[f"time_{test}"].values, dtype=float)[kept],
        input=np.asarray(driver.values, dtype=float)[kept] if driver is not None else np.empty(0),
        measured=np.asarray(observed.values, dtype=float)[kept],
        simulated=numbers(cluster.node.children["prediction"], test)[kept],
        baseline=_baseline(run.tree, test, kept),
        low=low[kept] if low.size else low,
        high=high[kept] if high.size else high,
    )


def _baseline(tree: xr.DataTree, test: str, kept: NDArray[np.bool_]) -> Array:
    node = tree.children["baseline"].children.get("prediction") if "baseline" in tree.children else None
    if node is None or test not in node.data_vars:
        return np.empty(0)
    return numbers(node, test)[kept]


def _band(cluster: Cluster, test: str) -> tuple[Array, Array]:
    """5 % and 95 % quantile of the model's output over the posterior."""
    predictive = cluster.node.children.get("posterior_predictive")
    if predictive is None or test not in predictive.data_vars:
        return np.empty(0), np.empty(0)
    draws = predictive.dataset[test].values
    ordered = np.sort(draws.reshape(-1, draws.shape[-1]), axis=0)
    last = len(ordered) - 1
    return ordered[round(0.05 * last)].astype(float), ordered[round(0.95 * last)].astype(float)


def output_unit(overlays: Sequence[Overlay]) -> Unit:
    """One display unit for the outputs of all tests."""
    return display_unit(overlays[0].output_unit, np.concatenate([overlay.measured for overlay in overlays]))


def overlay_section(run: Run) -> Section | None:
    """Loops of all solutions; traces and spectra of the best."""
    by_cluster = {cluster.name: found for cluster in run.shown if (found := extract_overlays(run, cluster))}
    if run.clusters[0].name not in by_cluster:
        return None
    best = by_cluster[run.clusters[0].name]
    baseline = run.baseline_title if any(o.baseline.size for o in best) else ""
    unit = output_unit(best)
    loops = {
        name: [o.last(1) for o in overlays if o.input.size and o.kind in ("sine", "quasi_static")]
        for name, overlays in by_cluster.items()
    }
    traces, spectra = [overlay.last(2) for overlay in best], extract_spectra([o for o in best if o.kind in BROADBAND])
    blocks: list[Block] = []
    if loops[best_name := run.clusters[0].name]:
        blocks.append(loops_figure(loops, unit, baseline))
    blocks.append(traces_figure(traces, unit, baseline, best_name))
    if spectra:
        blocks.append(spectra_figure(spectra, unit, baseline, best_name))
    if len(run.clusters) > SHOWN:
        blocks.append(Text(f"Drawn are the {SHOWN} best solutions; the tables list all {len(run.clusters)}."))
    data = {"loops": loops, "traces": traces, "spectra": spectra}
    return Section("overlay", "Measured and simulated", blocks, data)
