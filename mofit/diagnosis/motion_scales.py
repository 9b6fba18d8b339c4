"""Ranges of effects from the motion of the fitted model, where neither the model nor the records tell their scale.

A file of one's own seldom says for which rig the ranges of shipped effects are written; what its masses and springs do
in these tests is known once it is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.inner_signals import InnerSignals, inner_signals
from mofit.models import Effect
from mofit.models.extended_model import target_of
from mofit.models.library.dampers import TYPICAL_STROKE

#: Forces by other names.
_FORCES = ("force", "vertical_force")
#: The quantity whose motion tells a scale, and its rate.
_DEFLECTION = "deflection"


def motion_scales(baseline: Fitted, effects: Sequence[Effect], scales: Mapping[str, float]) -> list[dict[str, float]]:
    """Of every effect: scales that the data do not tell, relative to those for which its ranges are written.

    Those of displacement and velocity are the ranges of the model's deflection and of its rate, that of force is the
    range of what the effect acts on; the geometric mean over the tests.

    Parameters
    ----------
    baseline
        The model without these effects.
    effects
        Of `mofit.diagnosis.candidates.choose_effects`.
    scales
        Those that are known (`mofit.simulation.ranges.data_scales`).
    """
    unknown = {name for name in TYPICAL_STROKE if name not in scales}
    if any(name in scales for name in _FORCES):
        unknown.discard("force")
    if not unknown:
        return [{} for _ in effects]
    motion = inner_signals(baseline)
    found = []
    for effect in effects:
        sizes = {"force": _range(motion, target_of(effect, motion.model))} if "force" in unknown else {}
        for order, name in enumerate(("displacement", "velocity")):
            if name in unknown:
                sizes[name] = _range(motion, _DEFLECTION, order)
        found.append({name: size / TYPICAL_STROKE[name] for name, size in sizes.items() if size > 0})
    return found


def _range(motion: InnerSignals, name: str, order: int = 0) -> float:
    """Peak-to-peak range of a signal or of its rate, the geometric mean over the tests that move it; else 0."""
    ranges = []
    for own, used, experiment in zip(motion.signals, motion.used, motion.experiments, strict=True):
        if name not in own:
            return 0.0
        values: FloatArray = own[name][used]
        for _ in range(order):
            values = np.gradient(values, experiment.step)
        ranges.append(float(np.ptp(values)))
    usable = [one for one in ranges if np.isfinite(one) and one > 0]
    return float(np.exp(np.mean(np.log(usable)))) if usable else 0.0
