"""How far the gap shrinks once the effect is added, by kind of hold-out: what the result holds and says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.remainder import Evidence, left_on_new_records

#: What is left out of the fit, the least demanding kind first: a test, a group of tests, records of another kind.
Kind = Literal["test", "group", "records"]
KINDS: tuple[Kind, ...] = ("test", "group", "records")
#: Most decimals of a share in per cent: what is left of the gap is hardly known to a millionth.
_DECIMALS = 4
#: So many times more probable without an effect is a hold-out that contradicts it: one in as many, where it holds.
_ODDS = 1000.0
#: Share of the gap that must go on hold-outs for what stands for a law that is not known.
HALF = 0.5
#: From so many powers of ten on a ratio is told as one.
_DECADES = 3
_PLACES = {"test": "tests left out in turn", "group": "whole groups of tests left out", "records": "records held out"}


@dataclass(frozen=True)
class HeldOut:
    """Predictions of a test by fits to others.

    ``before`` and ``after`` are the outputs without and with the effect over the samples used, (n,), from ``start`` on.
    """

    test: str
    output: str
    start: int
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True)
class HoldOut:
    """One hold-out: what was left out of the fit, and the share of the gap that the effect removes there.

    Parameters
    ----------
    name
        Of the test, or of what the tests of a group have in common.
    tests
        Those left out.
    share, low, high
        Share of their gap, with its 90 % interval; 0 where the fit runs away.
    ran_away
        Whether the fit to the other tests runs away: nothing is removed, then.
    predictions
        Of the tests left out.
    gain
        By how much minus twice the logarithm of their predictive density falls with the effect, see
        `mofit.diagnosis.predictive_density.deviance`; 0 where that is not known.
    later
        Whether they are those that begin last, left out because an effect follows the run order.
    """

    name: str
    tests: tuple[str, ...]
    share: float
    low: float
    high: float
    ran_away: bool = False
    predictions: tuple[HeldOut, ...] = ()
    gain: float = 0.0
    later: bool = False

    @property
    def in_words(self) -> str:
        """The test, or what the tests have in common."""
        alone = self.tests == (self.name,)
        return self.name if alone else f"the tests of {self.name} ({', '.join(self.tests)})"


@dataclass(frozen=True)
class Share:
    r"""Share of the gap that the effect removes on hold-outs of one kind.

    .. math:: \eta = 1 - \frac{\sum_t g_{t, \mathrm{with}}^2}{\sum_t g_{t, \mathrm{without}}^2}

    with :math:`g_t^2` the mean square of the prediction's error on test t relative to the output's range, beyond the
    noise; every sample counts alike, however noisy.

    Parameters
    ----------
    share
        Of tests and groups: of the predictions against the fit to all tests and what it leaves. Of records: against the
        measured outputs. Hold-outs without which the fit runs away count as nothing removed.
    low, high
        90 % interval of the share on another record like those held out; the upper end is that of the hold-outs that
        hold.
    observed
        The predictions against the measured outputs themselves, noise subtracted: no model in between, but the noise
        hides a small gap. Of the hold-outs that hold.
    evidence
        What the hold-outs that hold tell of other records.
    """

    kind: Kind
    share: float
    low: float
    high: float
    observed: float
    hold_outs: tuple[HoldOut, ...]
    evidence: tuple[Evidence, ...] = ()

    @property
    def gain(self) -> float:
        """That of all hold-outs."""
        return sum(one.gain for one in self.hold_outs)

    @property
    def contradicting(self) -> tuple[HoldOut, ...]:
        """Hold-outs far more probable without the effect; where it holds, there is one with a probability of 0.1 %."""
        limit = 2 * np.log(len(self.hold_outs) * _ODDS) if self.hold_outs else 0.0
        return tuple(one for one in self.hold_outs if one.gain < -limit)

    def foretelling(self, tests: Sequence[Evidence], seed: int) -> Share:
        """The same with the interval of another record like these; ``tests`` tell how those differ.

        A record like those without which the fit runs away has nothing removed.
        """
        if not self.evidence:
            return self
        left = left_on_new_records(self.evidence, tests, np.random.default_rng(seed), alike=self.kind == "records")
        high = 1 - float(np.quantile(left, 0.05))
        away = sum(one.ran_away for one in self.hold_outs)
        left[: round(away / (away + len(self.evidence)) * len(left))] = 1.0
        low = 1 - float(np.quantile(left, 0.95))
        return replace(self, low=min(low, self.share), high=max(high, self.share))

    @property
    def place(self) -> str:
        """Where the gap shrinks so far, in words."""
        return _PLACES[self.kind]


@dataclass(frozen=True)
class Shrinkage:
    """How far the gap shrinks, by kind of hold-out.

    Parameters
    ----------
    shares
        The kinds at hand, the most demanding one last.
    predicted
        Share on tests left out in turn from the score test alone, before any refit; None with one test.
    ran_away
        Hold-outs without which the fits run away: the other tests do not determine the effect.
    note
        Why the records held out are not predicted, if they are not.
    """

    shares: tuple[Share, ...]
    predicted: float | None = None
    ran_away: tuple[HoldOut, ...] = ()
    note: str = ""

    @property
    def headline(self) -> Share:
        """The share on the most demanding kind at hand."""
        return self.shares[-1]

    def of(self, kind: Kind) -> Share | None:
        """The share on one kind of hold-out; None if it is not at hand."""
        return next((one for one in self.shares if one.kind == kind), None)

    @property
    def of_cause(self) -> float:
        """The share by which a cause is graded, 0 if there is none.

        That of tests like those that named it, as how far its law reaches is another question; but a cause explains
        most of the gap on whole groups of tests, too. Of a law of the time it is the question, so that it must hold on
        the latest tests, too.
        """
        alike, together = self.of("test"), self.of("group")
        held_out = (*self.ran_away, *(together.hold_outs if together else ()))
        counted = [one.share for one in held_out if one.later]
        counted += [together.share] if together and together.share <= HALF else []
        return min([alike.share, *counted]) if alike else 0.0

    @property
    def contradicting(self) -> tuple[HoldOut, ...]:
        """Hold-outs that contradict the effect, see `Share.contradicting`; a test that is a group once."""
        found = dict[tuple[str, ...], HoldOut]()
        for one in (one for share in self.shares for one in share.contradicting):
            found.setdefault(one.tests, one)
        return tuple(found.values())

    @property
    def refutes(self) -> bool:
        """Whether a hold-out contradicts the effect, or tests left out in turn are no more probable with it.

        Or most of the gap stays there.
        """
        alike = self.of("test")
        return bool(self.contradicting or self.leaving_most) or (alike is not None and alike.gain <= 0)

    @property
    def leaving_most(self) -> tuple[Share, ...]:
        """Shares on tests left out, or groups of them, whose 90 % interval ends below half of the gap."""
        return tuple(one for one in self.shares if one.kind != "records" and one.high < HALF)

    @property
    def reaches(self) -> bool:
        """Whether more than half of the gap goes on every kind of hold-out, and no fit runs away."""
        return not self.ran_away and all(one.share > HALF for one in self.shares)

    def shows_help(self, kind: Kind = "test") -> bool:
        """Whether the 90 % interval on another such hold-out lies above nothing; where there is none it is unknown."""
        share = self.of(kind)
        return share is None or share.low > 0

    @property
    def sentence(self) -> str:
        """The headline with its interval, and beside it the least demanding kind."""
        head, least = self.headline, self.shares[0]
        share, low, high = (in_percent(value) for value in (head.share, head.low, head.high))
        names = "" if head.kind == "test" else f" ({'; '.join(one.name for one in head.hold_outs)})"
        beside = "" if head is least else f"; on {least.place} {in_percent(least.share)} %"
        return f"On {head.place}{names} it removes {share} % of the gap ({low} to {high} %){beside}."

    @property
    def caveat(self) -> str:
        """What to know of the shares; empty if nothing."""
        away = (
            f"Not determined without {_listed(self.ran_away)}: the fit to the other tests runs away, "
            "and nothing counts as removed there."
            if self.ran_away
            else ""
        )
        return " ".join(part for part in (away, self._not_told, self.note) if part)

    @property
    def _not_told(self) -> str:
        """That these tests do not tell the share on new records, though that there is one."""
        alike = self.of("test")
        if self.headline.low > 0 or alike is None or self.refutes:
            return ""
        return (
            "How much it removes on new records these tests do not tell: the interval holds 0 %. That it helps, they "
            f"do: tests left out in turn are {_times(alike.gain)} as probable with it."
        )

    @property
    def reason(self) -> str:
        """Why there is no share at all."""
        if not self.ran_away:
            return self.note or "there is only one test, so none can be left out"
        away = (
            f"without {_listed(self.ran_away)} the fit to the other tests runs away: they do not determine the effect"
        )
        return f"{away}. {self.note}".removesuffix(". ")


def in_percent(share: float) -> str:
    """A share in per cent, with decimals enough near 100 % to tell what is left: 99.8, 99.95."""
    left = 1 - share
    decimals = int(np.clip(-np.floor(np.log10(100 * left)), 1, _DECIMALS)) if left > 0 else 1
    most = 100 - 10.0**-decimals if left > 0 else np.inf
    return f"{min(100 * share, most):.{decimals}f}"


def _times(gain: float) -> str:
    """How many times as probable, from twice the logarithm."""
    decades = gain / (2 * np.log(10))
    return f"10^{decades:.0f} times" if decades >= _DECADES else f"{10**decades:.2g} times"


def _listed(hold_outs: Sequence[HoldOut]) -> str:
    return " or ".join(one.in_words for one in hold_outs)


def labelled_shares(kinds: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Of the kinds in a summary: each with its name, and every group and record, as rows of a table."""
    for kind in kinds:
        own = [] if kind["kind"] == "test" else kind["hold_outs"]
        if len(own) == 1:
            yield f"{kind['place']}: {own[0]['name']}", kind
        else:
            yield kind["place"], kind
            yield from ((f"{kind['kind']}: {one['name']}", one) for one in own)
