"""Measured output of each test beside what the posterior's draws predict."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mofit.report.overlay import Overlay, extract_overlays, judged
from mofit.report.run import Array, Cluster, Run

NINETY = 1.6449
"""Half-width of the 90 % interval of a Gaussian, in standard deviations."""


@dataclass(frozen=True)
class Prediction:
    """One test: its samples that counted, and the model's output at posterior draws (n, samples), SI units."""

    overlay: Overlay
    frequency: float
    noise_floor: float
    draws: Array

    @property
    def middle(self) -> Array:
        """Mean of the draws."""
        return np.asarray(self.draws.mean(axis=0))

    @property
    def half_width(self) -> Array:
        """Half of the 90 % band of a new sample: spread of the draws and noise of the measurement together."""
        return np.asarray(NINETY * np.hypot(self.draws.std(axis=0), self.overlay.noise_sd))

    @property
    def inside(self) -> float:
        """Share of the measured samples within that band; 90 % if the model is right."""
        return float(np.mean(np.abs(self.overlay.measured - self.middle) <= self.half_width))

    def last_period(self) -> Prediction:
        """Its last full period, or what stands for it."""
        part = self.overlay.last(1)
        start = int(np.searchsorted(self.overlay.time, part.time[0]))
        return replace(self, overlay=part, draws=self.draws[:, start : start + part.time.size])


def extract_predictions(run: Run, cluster: Cluster) -> list[Prediction]:
    """Every test of which the cluster holds draws."""
    node = cluster.node.children.get("posterior_predictive")
    if node is None:
        return []
    frequency = dict(zip(run.tests, run.of_tests("frequency"), strict=True))
    floor = dict(zip(run.tests, run.of_tests("noise_floor"), strict=True))
    found = []
    for overlay in extract_overlays(run, cluster):
        if overlay.test in node.data_vars:
            values = np.asarray(node.dataset[overlay.test].values, dtype=float)
            draws = values.reshape(-1, values.shape[-1])[:, judged(run, overlay.test)]
            found.append(Prediction(overlay, float(frequency[overlay.test]), float(floor[overlay.test]), draws))
    return found
