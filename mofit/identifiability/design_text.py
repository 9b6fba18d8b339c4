"""A design in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mofit.identifiability.verdicts import COMBINATION, IDENTIFIABLE, NOT, ONE_SIDED

#: How good a verdict is, for colours.
GRADES = {IDENTIFIABLE: "good", COMBINATION: "fair", ONE_SIDED: "fair", NOT: "bad"}

#: What a test's settings are shown as, in this order.
_SETTINGS = ("frequency", "last_frequency", "lines", "amplitude", "ramp_rate", "periods", "duration", "conditions")


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


def value_text(told: Mapping[str, Any], value: float) -> str:
    """A value of the criterion."""
    return f"{value:.3g}" if told["criterion"]["name"] == "T" else f"{100 * value:.3g} %"


def criterion_text(told: Mapping[str, Any]) -> str:
    """What was sought, and what it came to."""
    own = told["criterion"]
    of = ", ".join(own["of"])
    what = {
        "T": f"Noncentrality of the test between {of}",
        "c": f"Relative standard deviation of {of}",
        "D": f"Mean radius of the confidence ellipsoid of {of}",
        "A": f"Root mean square relative standard deviation of {of}",
        "E": f"Relative standard deviation in the worst direction of {of}",
    }[own["name"]]
    how = "every programme was looked at" if told["exhaustive"] else "found by exchanges"
    over = f"{'mean' if own['robust'] == 'mean' else 'worst'} over {told['points']} parameter sets"
    before, after = value_text(told, own["before"]), value_text(told, own["after"])
    return f"{what}: {before} before, {after} after {told['seconds']:.0f} s more ({over}; {how})."


def seconds_text(seconds: float) -> str:
    """A time, in minutes where it is long."""
    return f"{seconds:.4g} s" if seconds < 600 else f"{seconds / 60:.3g} min"
