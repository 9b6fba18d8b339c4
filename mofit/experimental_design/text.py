"""Sentences and labels of the results, for terminal and pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.experimental_design.comparison_result import Comparison, InformationShare
from mofit.experimental_design.expected_profiles import ProfileInterval
from mofit.experimental_design.identifiability import COMBINATION, IDENTIFIABLE, NOT, ONE_SIDED, relative_size
from mofit.parameters import ParameterSpace

#: How good a verdict is, for colours.
GRADES = {IDENTIFIABLE: "good", COMBINATION: "fair", ONE_SIDED: "fair", NOT: "bad"}
#: Share of a parameter's information below which a test counts as contributing nothing.
NOTHING = 0.01
#: Share of the tests' information that the tests which are named contribute together.
_MOST = 0.6
#: Settings of a test that are shown, in this order.
_SETTINGS = ("frequency", "last_frequency", "lines", "amplitude", "ramp_rate", "periods", "duration", "conditions")


def verdict_sentence(
    name: str,
    verdict: str,
    relative_sd: float,
    profile: ProfileInterval | None,
    correlated: Sequence[str],
    covariance: FloatArray,
    values: FloatArray,
    space: ParameterSpace,
) -> str:
    """Why a parameter has its verdict.

    The relative standard deviation is over the magnitude of the value. Parameters that are ``correlated`` compensate
    for a change of this one. The covariance (d, d) is in the unit cube, with the bounds; values (d,) are for reference.
    """
    if verdict == IDENTIFIABLE:
        return f"{name} is identifiable: expected standard deviation {percent(relative_sd)}."
    if verdict == COMBINATION:
        trade = _compensation(name, correlated[0], covariance, values, space) if correlated else ""
        text = f"{name} is identifiable only in a combination with {listed(correlated)}"
        return f"{text}{': ' + trade if trade else ''} (alone ±{percent(relative_sd)})."
    if verdict == ONE_SIDED and profile is not None:
        bound, kind = (profile.low, "lower") if np.isfinite(profile.low) else (profile.high, "upper")
        unit = space[name].unit
        return f"{name} has only a {kind} limit, about {bound:.3g} {unit}; the other side is open to its bound."
    if profile is not None and profile.closed == 2:
        return f"{name} is not identifiable: expected standard deviation {percent(relative_sd)}."
    return f"{name} is not identifiable: within its bounds the data hardly depend on it."


def _compensation(name: str, other: str, covariance: FloatArray, values: FloatArray, space: ParameterSpace) -> str:
    """How another parameter compensates for a change: ``b −4 % compensates for a +10 %``."""
    i, j = space.index(name), space.index(other)
    sizes = relative_size(space, values[None])[0]
    if values[i] == 0 or values[j] == 0:
        return ""
    change = 10 * covariance[j, i] / covariance[i, i] * sizes[i] / sizes[j]
    return f"{other} {'+' if change > 0 else '−'}{abs(change):.2g} % compensates for {name} +10 %"


def share_sentence(shares: InformationShare, place: int, name: str) -> str:
    """Which tests contribute the information on a parameter, and which contribute hardly any."""
    order = np.argsort(-shares.share[:, place], kind="stable")
    own = shares.share[order, place]
    names = [shares.tests[i] for i in order]
    most = int(np.searchsorted(np.cumsum(own), _MOST * own.sum())) + 1
    parts = [f"{test} ({percent(share)})" for test, share in zip(names[:most], own, strict=False)]
    text = f"Information on {name} in '{shares.experiment}' comes from {listed(parts)}"
    known = float(shares.calibration[place])
    for origin, share in (("calibration", known), ("the bounds alone", 1 - own.sum() - known)):
        if share > 1 - _MOST:
            text += f"; {percent(share)} of it comes from {origin}"
    none = [test for test, share in zip(names, own, strict=True) if share < NOTHING]
    return text + (f"; less than {percent(NOTHING)} each from {listed(none)}." if none else ".")


def augmentation_sentences(comparison: Comparison) -> list[str]:
    """What would make parameters identifiable that no experiment identifies."""
    found = []
    known = comparison.sources[0]
    for name, best in comparison.augmentations.items():
        if best is None:
            found.append(f"{name}: no single sine, chirp or step within ten minutes would make it identifiable.")
            continue
        each = best.seconds / best.repeats
        often = "" if best.repeats == 1 else f", {best.repeats} times"
        value = known.samples[0, known.source.space.index(name)]
        size = f"{100 * best.sd / abs(value):.2g} %" if value else f"{best.sd:.3g} {known.source.space[name].unit}"
        found.append(f"Cheapest augmentation for {name}: one more test, {best.test}, {each:g} s{often}: ±{size}.")
    return found


def settings_text(test: Mapping[str, Any]) -> str:
    """Settings of a test in a line."""
    shown = []
    for key in _SETTINGS:
        value = test.get(key)
        if not value:
            continue
        if key == "conditions":
            shown += [f"{name.replace('_', ' ')} {entry}" for name, entry in value.items()]
        elif key == "lines":
            shown.append("lines " + ", ".join(map(str, value)))
        elif key == "last_frequency":
            shown.append(f"to {value}")
        else:
            shown.append(f"{value:g} periods" if key == "periods" else str(value))
    return ", ".join(shown)


def value_text(design: Mapping[str, Any], value: float) -> str:
    """A value of a design's criterion."""
    return f"{value:.3g}" if design["criterion"]["name"] == "T" else f"{100 * value:.3g} %"


def criterion_text(design: Mapping[str, Any]) -> str:
    """The criterion of a design, its value before and after."""
    own = design["criterion"]
    of = ", ".join(own["of"]) + target_text(design)
    what = {
        "T": f"Noncentrality of the test between {of}" if len(own["of"]) > 1 else f"Noncentrality of the test for {of}",
        "c": f"Relative standard deviation of {of}",
        "D": f"Mean radius of the confidence ellipsoid of {of}",
        "A": f"Root mean square relative standard deviation of {of}",
        "E": f"Relative standard deviation in the worst direction of {of}",
    }[own["name"]]
    how = "every selection of tests was evaluated" if design["exhaustive"] else "found by exchanges"
    over = samples_text(design)
    before, after = value_text(design, own["before"]), value_text(design, own["after"])
    return f"{what}: {before} before, {after} after {design['seconds']:.0f} s more ({over}; {how})."


def target_text(design: Mapping[str, Any]) -> str:
    """`` under vertical_force = 3500 N``, of a design for a target; else nothing."""
    target = design["criterion"]["target"] or {}
    said = ", ".join(f"{name} = {one['value']:g} {one['unit']}" for name, one in target.items())
    return f" under {said}" if said else ""


def samples_text(design: Mapping[str, Any]) -> str:
    """How figures of a design are summed up over the parameter samples."""
    return (
        f"{'mean' if design['criterion']['robust'] == 'mean' else 'worst'} over {design['samples']} parameter samples"
    )


def seconds_text(seconds: float) -> str:
    """A time, in minutes where it is long."""
    return f"{seconds:.4g} s" if seconds < 600 else f"{seconds / 60:.3g} min"


def percent(value: float) -> str:
    """A ratio in per cent, two digits."""
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:.0f} %"


def listed(items: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join([", ".join(items[:-1]), items[-1]]) if len(items) > 1 else "".join(items)
