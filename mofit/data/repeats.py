"""Repeated records: tests driven alike, whose outputs differ by noise alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Measurement
from mofit.data.signals import REPEATED, SignalAnalysis, effective_samples

#: share of the range by which inputs that were commanded alike differ at most: rounding
_ROUNDING = 2e-4
#: share of the standard deviation by which measured inputs differ at most; more changes the output beyond the noise
_LIKE = 0.01
#: correlation of neighbours in the difference of two inputs, below which it is the noise of their sensors
_WHITE = 0.3
#: correlation of the difference of two outputs with what they share, above which a tenth of it follows the drive: two
#: specimens, or another drive, not noise
_FOLLOWS = 0.3
#: independent samples of that difference, so that this is three standard deviations of what chance correlates
_FEWEST = 100
#: relative difference of two sampling intervals or conditions that are the same
_SAME = 1e-4


def repeated(measurements: Sequence[Measurement]) -> list[list[int]]:
    """Indices of the tests that repeat one another, group by group; those that stand alone are in none.

    Repeats have the same kind, conditions, sampling and number of samples, and inputs that differ by no more than
    rounding or the white noise of their sensors. Specimens may be driven alike, too: the difference of the outputs must
    not follow the output that they share, and have enough independent samples to tell. Copies, which do not differ, are
    no repeats. The tests are compared in order, so that each joins the first group that it fits.
    """
    groups: list[list[int]] = []
    for k, one in enumerate(measurements):
        alike = next((group for group in groups if _alike(measurements[group[0]], one)), None)
        if alike is None:
            groups.append([k])
        else:
            alike.append(k)
    return [group for group in groups if len(group) > 1]


def noise_of_repeats(records: Sequence[FloatArray]) -> float:
    r"""Standard deviation of the noise, coloured or not, of n records of the same test.

    .. math:: \sigma^2 = \frac{1}{(n - 1)(N - 1)} \sum_{i,k} (y_{ik} - \bar y_i - (\bar y_k - \bar y))^2

    over samples k and records i: each record may have an offset of its own.
    """
    values = np.stack(records)
    values = values - values.mean(axis=1, keepdims=True)
    rest = values - values.mean(axis=0)
    return float(np.sqrt(np.sum(rest**2) / (len(values) - 1) / max(values.shape[1] - 1, 1)))


def with_repeats(
    measurements: Sequence[Measurement], analyses: Sequence[SignalAnalysis], groups: Sequence[Sequence[int]]
) -> tuple[SignalAnalysis, ...]:
    """The analyses with the noise of the outputs from `repeated` records, where the period did not tell it."""
    found = list(analyses)
    for group in groups:
        common = set.intersection(*(set(measurements[k].outputs) for k in group))
        noise = {name: noise_of_repeats([measurements[k].outputs[name] for k in group]) for name in sorted(common)}
        for k in (k for k in group if not found[k].repeats and noise):
            floor = {name: value / float(np.ptp(measurements[k].outputs[name])) for name, value in noise.items()}
            found[k] = replace(
                found[k],
                noise_sd={**found[k].noise_sd, **noise},
                noise_floor={**found[k].noise_floor, **floor},
                noise_method=REPEATED,
            )
    return tuple(found)


def _alike(one: Measurement, other: Measurement) -> bool:
    a, b = one.experiment, other.experiment
    if (a.kind, a.inputs.keys(), a.conditions.keys()) != (b.kind, b.inputs.keys(), b.conditions.keys()):
        return False
    if len(a.time) != len(b.time) or not a.inputs or abs(a.step - b.step) > _SAME * a.step:
        return False
    if not all(np.isclose(value, b.conditions[name], rtol=_SAME, atol=0.0) for name, value in a.conditions.items()):
        return False
    if not all(_same_drive(values, b.inputs[name]) for name, values in a.inputs.items()):
        return False
    common = [name for name in one.outputs if name in other.outputs]
    return bool(common) and all(_differ_by_noise(one.outputs[name], other.outputs[name]) for name in common)


def _same_drive(one: FloatArray, other: FloatArray) -> bool:
    difference = one - other
    if np.max(np.abs(difference)) <= _ROUNDING * np.ptp(one):
        return True
    rest = difference - difference.mean()
    size = float(np.sqrt(np.mean(rest**2)))
    if size > _LIKE * np.std(one) or abs(difference.mean()) > size:
        return False
    return bool(abs(np.mean(rest[1:] * rest[:-1])) < _WHITE * size**2)


def _differ_by_noise(one: FloatArray, other: FloatArray) -> bool:
    difference, shared = (values - values.mean() for values in (one - other, one + other))
    size = float(np.linalg.norm(difference) * np.linalg.norm(shared))
    if not size > 0:
        return False
    follows = abs(float(difference @ shared)) / size
    return follows < _FOLLOWS and effective_samples(difference) >= _FEWEST
