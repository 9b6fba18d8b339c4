r"""Signs and delays between channels, as far as physics or the other tests of a campaign tell them.

A passive specimen takes power from the rig in every cycle: its force leads the displacement by 0 to 180°. A force that
lags has the wrong sign or comes late. Without unstable zeros gain and phase belong together,
:math:`\varphi \approx \frac{\pi}{2} \, \mathrm{d} \ln |H| / \mathrm{d} \ln \omega` (Bode): a lag beyond that, growing
with the frequency, is a delay. Neither needs a model or a threshold in units.

References
----------
Bode, "Network Analysis and Feedback Amplifier Design" (1945), ch. 14.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Measurement
from mofit.data.response import Response
from mofit.errors import Issue
from mofit.quantities import SINGLE_EXCITATIONS

#: input and output that are positive together at low frequencies (docs/campaigns.md), and whether they carry power
_TOGETHER = {
    ("displacement", "force"): True,
    ("lateral_displacement", "lateral_force"): True,
    ("angle", "torque"): True,
    ("strain", "stress"): True,
    ("longitudinal_displacement", "longitudinal_force"): True,
    ("slip_angle", "lateral_force"): False,
    ("slip_ratio", "longitudinal_force"): False,
}


@dataclass(frozen=True)
class PhaseLimits:
    """Phases, in degrees, from which they are worth a note."""

    lag: float = 15.0
    """Of a passive specimen; sensors and filters of a rig make a few degrees."""
    opposite: float = 120.0
    """Between a test and those beside it: nearer to 180° than to a right angle."""
    alike: float = 60.0
    """Between tests that agree."""
    beside: float = 1.3
    """Ratio of two frequencies between which no resonance is expected."""
    delay: float = 45.0
    """Excess at the highest frequency: gain and phase belong together to about half of that where tests are few."""
    fewest: int = 3
    """Tests of different frequency that show how the phase grows."""
    linear: float = 0.95
    """Share of the variance of the excess that must grow with the frequency."""
    steepest: float = 1.0
    """Power of the frequency with which the gain may change, and change of it; beyond, few tests do not tell it."""
    steady: float = 0.4
    """Change of the delay when one test is left out."""
    level: float = 0.1
    """Power of the frequency up to which a gain counts as constant."""
    seen: float = 0.25
    """Share of the delay that the phase shows by itself."""
    inertia: float = 1.3
    """Power of the frequency from which the gain may be that of a mass, whose force is opposite to the motion."""
    correlated: float = 0.7
    """Correlation of input and output of a record that does not repeat, above which its sign means something."""


LIMITS = PhaseLimits()
_SIGN_HINT = "Check the sign of both sensors; a map turns a channel round with scale = -1"
_DELAY_HINT = "Check the time between the channels: filters, converters, clocks; or the specimen has a dead time"


def sign_and_delay_issues(found: Sequence[Response], measurements: Sequence[Measurement]) -> list[Issue]:
    """Outputs whose sign or time contradicts physics or the other tests of the campaign."""
    issues: list[Issue] = []
    for (driver, output), group in _pairs(found):
        delay, turned = _delay(group), _turned(group)
        if delay is not None:
            when = f"{1e3 * abs(delay):.3g} ms {'late' if delay > 0 else 'early'}"
            message = (
                f"comes {when}: its phase to '{driver}' changes with the frequency more than its amplitude explains"
            )
            issues.append(_issue(group, output, message, _DELAY_HINT))
        elif turned:
            together = f"; '{driver}' and '{output}' are positive together" if (driver, output) in _TOGETHER else ""
            spread = ", ".join(one.words for one in turned[:3])
            message = f"{spread}{' …' if len(turned) > 3 else ''}, as if one of the two had the opposite sign"
            issues.append(_issue(turned, output, message, _SIGN_HINT + together))
        late = [one for one in group if delay is None and one not in turned and _late(one)]
        if late:
            least = max(-one.phase / (2 * np.pi * one.frequency) for one in late)
            spread = ", ".join(one.words for one in late[:3])
            message = f"{spread}, which no passive specimen does: it comes at least {1e3 * least:.3g} ms late"
            issues.append(_issue(late, output, message, _DELAY_HINT))
    return issues + list(_correlations(measurements))


def _issue(tests: Sequence[Response], output: str, message: str, hint: str) -> Issue:
    return Issue(f"{_groups([one.test for one in tests])}, variable '{output}'", message, hint, "warning")


def _pairs(found: Sequence[Response]) -> Iterator[tuple[tuple[str, str], list[Response]]]:
    """Responses of one output over one input, by frequency."""
    ordered = sorted(found, key=lambda one: (one.input, one.output, one.frequency))
    for pair, group in groupby(ordered, key=lambda one: (one.input, one.output)):
        yield pair, list(group)


def _degrees(one: Response) -> float:
    return float(np.degrees(one.phase))


def _late(one: Response) -> bool:
    return _TOGETHER.get((one.input, one.output), False) and -90 <= _degrees(one) < -LIMITS.lag


def _turned(group: Sequence[Response]) -> list[Response]:
    """Tests with the wrong sign: by physics, or because they are opposite to those beside them."""
    pair = group[0].input, group[0].output
    if pair in _TOGETHER:
        against = [one for one in group if abs(_degrees(one)) >= 90 and not _driven_by_inertia(one)]
        if len(against) == len(group) and _growth(group) < LIMITS.inertia:
            return list(group)
        found = [one for one in against if _without_mass(one, group) or _backward(one)]
    else:
        found = []
    return found + [one for one in _against_neighbours(group) if one not in found]


def _backward(one: Response) -> bool:
    """Whether the specimen gives power to the rig, with a force against the motion."""
    return _TOGETHER[one.input, one.output] and -180 + LIMITS.lag < _degrees(one) < -90


def _without_mass(one: Response, group: Sequence[Response]) -> bool:
    """Whether no mass explains a force against the motion: it would act at higher frequencies, and change the gain."""
    along = [other for other in group if abs(_degrees(other)) < LIMITS.alike]
    return abs(_degrees(one)) >= LIMITS.opposite and any(
        other.frequency > one.frequency or max(one.gain / other.gain, other.gain / one.gain) < 1.2 for other in along
    )


def _driven_by_inertia(one: Response) -> bool:
    """A force that leads by more than a right angle may carry a mass."""
    return 90 <= _degrees(one) < 180 - LIMITS.lag


def _growth(group: Sequence[Response]) -> float:
    """Power of the frequency with which the gain grows; 2 for a mass."""
    first, last = group[0], group[-1]
    return float(np.log(last.gain / first.gain) / np.log(_ratio(first, last))) if _ratio(first, last) > 1.05 else 0.0


def _apart(one: Response, other: Response) -> float:
    """Phase between two responses, 0 to 180°."""
    return float(abs(np.degrees(np.angle(np.exp(1j * (one.phase - other.phase))))))


def _against_neighbours(group: Sequence[Response]) -> list[Response]:
    """Tests opposite to those beside them, which agree: no resonance turns the phase there and back."""
    found = []
    for k, one in enumerate(group):
        near = [other for other in group if other is not one and _ratio(one, other) <= LIMITS.beside]
        beside = near if len(near) >= 2 else [*group[max(k - 1, 0) : k], *group[k + 1 : k + 2]]
        agree = all(_apart(other, beside[0]) <= LIMITS.alike for other in beside)
        if len(beside) >= 2 and agree and all(_apart(one, other) >= LIMITS.opposite for other in beside):
            found.append(one)
    if not found and len(group) == 2 and _ratio(*group) <= LIMITS.beside and _apart(*group) >= LIMITS.opposite:
        found = [group[1]]
    return found


def _ratio(one: Response, other: Response) -> float:
    return max(one.frequency, other.frequency) / min(one.frequency, other.frequency)


def _delay(group: Sequence[Response]) -> float | None:
    """Time by which the output comes late, in s; None where gain and phase belong together."""
    # of one amplitude, because the gain of a specimen that is not linear depends on it
    alike = max(
        ([o for o in group if one.amplitude <= 1.2 * o.amplitude <= 1.44 * one.amplitude] for one in group), key=len
    )
    frequency, phase, slope = _gain_and_phase(alike)
    if len(frequency) < LIMITS.fewest or max(np.ptp(slope), np.max(np.abs(slope))) > LIMITS.steepest:
        return None
    omega, excess = 2 * np.pi * frequency, np.degrees(phase) - 90 * slope
    rate, start = np.polyfit(omega, excess, 1)
    left = np.sum((excess - start - rate * omega) ** 2) / max(np.sum((excess - excess.mean()) ** 2), 1e-300)
    # a delay does not hang on the lowest or the highest test; a resonance that begins there does
    others = [np.polyfit(omega[part], excess[part], 1)[0] for part in (slice(1, None), slice(None, -1))]
    steady = all(abs(other - rate) <= LIMITS.steady * abs(rate) for other in others)
    # before a zero the gain falls while the phase rises, before a resonance it rises while the phase falls
    passive = _TOGETHER.get((group[0].input, group[0].output), False)
    steady &= bool(np.min(slope) > -LIMITS.level if rate > 0 else passive or np.max(slope) < LIMITS.level)
    steady &= np.polyfit(omega, np.degrees(phase), 1)[0] / rate >= LIMITS.seen
    large = abs(rate) * omega[-1] >= LIMITS.delay and abs(start) <= LIMITS.delay
    return float(-np.radians(rate)) if large and steady and left <= 1 - LIMITS.linear else None


def _gain_and_phase(group: Sequence[Response]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies, phase without jumps, and slope of the gain, both logarithmic; tests of one frequency as one."""
    kept: list[list[Response]] = []
    for one in group:
        if kept and _ratio(kept[-1][0], one) < 1.05:
            kept[-1].append(one)
        else:
            kept.append([one])
    frequency = np.array([np.mean([one.frequency for one in same]) for same in kept])
    response = np.array([np.mean([np.exp(1j * one.phase) for one in same]) for same in kept])
    gain = np.log([np.median([one.gain for one in same]) for same in kept])
    slope = np.gradient(gain, np.log(frequency)) if len(kept) > 1 else np.zeros(len(kept))
    return frequency, np.unwrap(np.angle(response)), slope


def _correlations(measurements: Sequence[Measurement]) -> Iterator[Issue]:
    """Records that do not repeat and move against what physics says, or against the others of their kind."""
    signs: dict[tuple[str, str, str], list[tuple[str, float]]] = {}
    for measurement in measurements:
        if measurement.kind == "sine" or not measurement.experiment.inputs:
            continue
        driver, x = next(iter(measurement.experiment.inputs.items()))
        for output, y in measurement.outputs.items():
            pair = (measurement.kind, driver, output)
            agreement = _settled(x, y) if measurement.kind in SINGLE_EXCITATIONS else _correlation(x, y)
            signs.setdefault(pair, []).append((measurement.name, agreement))
    for (kind, driver, output), entries in signs.items():
        clear = [(test, value) for test, value in entries if abs(value) > LIMITS.correlated]
        known = kind in (*SINGLE_EXCITATIONS, "quasi_static") and (driver, output) in _TOGETHER
        minority = [test for test, value in clear if value < 0]
        if not known and len(minority) > len(clear) / 2:
            minority = [test for test, value in clear if value > 0]
        if minority and (known or len(clear) - len(minority) >= 2):
            against = "" if known else f", other than in the other {kind} tests"
            message = f"moves against '{driver}'{against}: as if one of them had the opposite sign"
            if not known:
                message = (
                    f"moves the other way with '{driver}' than in the other {kind} tests: as if a sign had changed"
                )
            yield Issue(f"{_groups(minority)}, variable '{output}'", message, _SIGN_HINT, "warning")


def _settled(x: FloatArray, y: FloatArray) -> float:
    """How far the output ends beyond where it began, in ranges, in the direction of the input."""
    tenth = max(len(x) // 10, 1)
    moves = [np.mean(values[-tenth:]) - np.mean(values[:tenth]) for values in (x, y)]
    return float(np.sign(moves[0]) * moves[1] / np.ptp(y)) if np.ptp(y) > 0 else 0.0


def _correlation(x: FloatArray, y: FloatArray) -> float:
    """Of two signals; 0 where one is constant."""
    if not (np.ptp(x) > 0 and np.ptp(y) > 0):
        return 0.0
    x, y = (x - x.mean()) / np.ptp(x), (y - y.mean()) / np.ptp(y)
    return float(x @ y / np.sqrt((x @ x) * (y @ y)))


def _groups(names: Sequence[str]) -> str:
    return f"group{'s' if len(names) > 1 else ''} {', '.join(map(repr, names))}"
