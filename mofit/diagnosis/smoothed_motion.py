"""The motion along which terms are read: the fitted model's, moved to what the records tell.

Where the gap is large, the rig moved elsewhere than the model, and along the model's motion a law looks like another
one. So do the derivatives by the parameters: of a linear model they are exact along the motion of the rig.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.inner_signals import InnerSignals, Target, stacked
from mofit.diagnosis.integration import stable
from mofit.diagnosis.linear_response import LinearResponse
from mofit.diagnosis.missing_signal import MissingSignal
from mofit.diagnosis.term_rows import Linearisation, Reading, term_signals, whitened_response
from mofit.diagnosis.terms import Term
from mofit.runtime.parallel import forked_map

#: Steps of the walk per sample that are tried, relative to the largest magnitude of the quantity.
_STEPS = np.geomspace(1e-5, 1.0, 6)


def fitted_readings(signals: InnerSignals, targets: Sequence[Target]) -> list[Reading]:
    """Of each of some quantities the motion of a fitted model as it is."""
    responses = signals.responses([target.name for target in targets])
    return [
        Reading(target, signals, responses, k, Linearisation.of(signals.fitted)) for k, target in enumerate(targets)
    ]


def smoothed_readings(fitted: Sequence[Reading]) -> list[Reading]:
    """Of each of some quantities the fitted motion, the same for all, smoothed for whatever is missing there.

    As it is where what is added moves no state.
    """
    if not fitted:
        return []
    signals, responses = fitted[0].motion, fitted[0].responses
    found, moving = list(fitted), [k for k in range(len(fitted)) if _moves(responses, k)]
    if not moving:
        return found
    scales, count = np.array([fitted[k].target.scale for k in moving]), signals.fitted.hypothesis.observed.processes
    with np.errstate(all="ignore"):
        missing = list(_missing(signals, responses, moving, scales))
    steps = _STEPS[np.argmax(sum(forked_map(_log_likelihoods, missing, count)), axis=1)]
    shifts = forked_map(partial(_shifts, steps), missing, count)
    motions = []
    for place in range(len(moving)):
        pairs = zip(signals.signals, [shift[:, place] for shift in shifts], responses, strict=True)
        motions.append(replace(signals, signals=tuple(_moved(old, shift, one.states) for old, shift, one in pairs)))
    besides = forked_map(partial(_beside, signals), motions, count)
    for k, motion, own in zip(moving, motions, besides, strict=True):
        found[k] = replace(fitted[k], motion=motion, beside=own)
    return found


def readings_without(
    own: InnerSignals, smoothed: Reading, terms: Sequence[tuple[Term, float]], targets: Sequence[Target]
) -> list[Reading]:
    """Of each of some quantities the smoothed motion of a fit, without the fit's own terms.

    Along a motion that comes near the records, what replaces them does about the same as they do with their
    coefficients. ``own`` are the fit's signals, and ``smoothed`` is the reading where the terms act; they are the last
    of its effects.
    """
    motion, beside, model = smoothed.motion, smoothed.beside, own.fitted.hypothesis
    sizes = np.array([[size] for _, size in terms])
    with np.errstate(all="ignore"):
        added = [each @ sizes for each in term_signals(motion, [term for term, _ in terms])]
        residual = beside.residual.copy()
        residual[: len(model.observed.measured)] += whitened_response(smoothed, added)[:, 0]
        responses = own.responses([target.name for target in targets])
    kept = np.arange(len(beside.free)) < len(beside.free) - len(model.effects[-1].parameters)
    without = Linearisation(residual, beside.slopes[:, kept[beside.free]], beside.free & kept)
    return [Reading(target, motion, responses, k, without) for k, target in enumerate(targets)]


def _log_likelihoods(missing: MissingSignal) -> FloatArray:
    with np.errstate(all="ignore"):
        return missing.log_likelihoods(_STEPS)


def _shifts(steps: FloatArray, missing: MissingSignal) -> FloatArray:
    with np.errstate(all="ignore"):
        return missing.smoothed(steps)


def _moves(responses: Sequence[LinearResponse], quantity: int) -> bool:
    """Whether what is added to a quantity moves any state."""
    return any(np.any(one.driven[:, :, quantity]) for one in responses)


def _moved(signals: Mapping[str, FloatArray], shift: FloatArray, states: Sequence[str]) -> dict[str, FloatArray]:
    return {**signals, **{name: signals[name] + shift[:, j] for j, name in enumerate(states)}}


def _beside(fitted: InnerSignals, smoothed: InnerSignals) -> Linearisation:
    """The fit with its derivatives by the free parameters along the smoothed motion."""
    found = Linearisation.of(fitted.fitted)
    model, outputs = fitted.fitted.hypothesis, []
    names = model.layout.parameters.names
    with np.errstate(all="ignore"):
        pairs = zip(fitted.responses((), names), smoothed.responses((), names), fitted.experiments, strict=True)
        for here, there, experiment in pairs:
            changes = {key: getattr(there, key) - getattr(here, key) for key in ("driven", "direct", "start")}
            more, whole = replace(here, **changes), np.ones((experiment.samples, 1))
            outputs.append(np.concatenate([more.of(k, whole) for k in range(len(names))], axis=2)[experiment.lead :])
        rows = model.layout.spread(model.observed.whitened(outputs)[None], model.observed.test)[0]
    if stable(rows):
        found.slopes[: len(rows)] += (rows * fitted.fitted.derivative)[:, found.free]
    return found


def _missing(
    signals: InnerSignals, responses: Sequence[LinearResponse], quantities: Sequence[int], scales: FloatArray
) -> Iterator[MissingSignal]:
    """Of every test what may be missing on some quantities, of these magnitudes."""
    observed, point = signals.fitted.hypothesis.observed, signals.fitted.minimum.point[None]
    simulated = signals.fitted.hypothesis.outputs(point)
    tests = zip(responses, signals.signals, signals.experiments, strict=True)
    for test, (response, own, experiment) in enumerate(tests):
        count = response.seen.shape[1]
        errors, variance = np.full((experiment.samples, count), np.nan), np.ones(count)
        for i, (of, output, w) in enumerate(observed.records):
            if of == test:
                used = slice(w.start, w.start + w.count)
                errors[signals.used[test], output] = observed.used_samples(i) - simulated[test][0][0][used, output]
                variance[output] = w.noise_sd**2
        spread = np.abs(stacked(own, response.states, experiment.samples)).max(axis=0)
        yield MissingSignal.of(response, quantities, scales, spread, errors, variance)
