"""What a diagnosis says in words: what causes the gap, what is left of it, and where."""

from __future__ import annotations

from collections.abc import Sequence

from mofit.diagnosis.left_residual import Residuals
from mofit.diagnosis.residual_map import Location
from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES

#: An effect in words: its family and its own title.
Law = tuple[str, str]

#: p-value below which only the bound is printed.
_SMALLEST = 1e-16
_PHRASES = {one.name: one.phrase for one in SPECTRAL_CLASSES}


def cause(laws: Sequence[Law], others: Sequence[Law] = (), left: str = "") -> str:
    """What causes the gap, family first, what else may, and what is ``left`` where that is not all."""
    what = "most of the gap" if left else "the gap"
    rest = f"; {left}" if left else ""
    if len(laws) > 1:
        listed = " and ".join(f"{family}{_best_law(family, title)}" for family, title in laws)
        start = f"Several effects cause {what}: {listed}{rest}."
        doubtful = [title for family, title in laws if all(other == family for other, _ in others)]
        named = doubtful[0] if len(doubtful) == 1 else "them"
    else:
        ((family, title),) = laws
        start = f"{family[0].upper()}{family[1:]} causes {what}{_best_law(family, title)}{rest}."
        # the family is beyond doubt if all have it
        named = "this law" if all(other == family for other, _ in others) else "it"
    doubt = f" These data cannot distinguish {named} from {' or '.join(title for _, title in others)}."
    return start + (doubt if others else "")


def rig_and_model(laws: Sequence[tuple[str, bool]], *, all_of_it: bool) -> str:
    """What the rig adds, and what the model lacks: of each effect its title, and whether it is the rig's.

    ``all_of_it``: whether they are the whole gap, beyond doubt.
    """
    rig, model = ([title for title, of_rig in laws if of_rig == whose] for whose in (True, False))
    if not rig:
        return ""
    if all_of_it and not model:
        return f" {'That is' if len(rig) == 1 else 'These are'} of the rig; the model need not change."
    return f" The rig adds {' and '.join(rig)}" + (f"; the model lacks {' and '.join(model)}." if model else ".")


def _best_law(family: str, title: str) -> str:
    return "" if family == title else f" (best law: {title})"


def left_over(share: float, location: Location | None) -> str:
    """How much of the gap's mean square is left, and where most of that lies."""
    left = f"{100 * share:.0f} % of its mean square is left in the fit to all tests"
    if location is None:
        return left
    lines = _PHRASES.get(location.lines, "")
    place = f"on {lines} of {location.test}" if lines and location.test else f"on {lines}" if lines else ""
    return f"{left}, most of it {place or f'in {location.test}'}"


def nearest(titles: Sequence[str], share: float, unconfirmed: bool = False) -> str:
    """How much the best model leaves of a gap that it does not explain, and whether tests left out confirm it."""
    percent, doubt = (f"{100 * share:.0f}", "") if round(100 * share) else ("less than 0.5", ", which is significant")
    held_out = ", but tests left out do not confirm it" if unconfirmed else ""
    return f". The nearest, {' with '.join(titles)}, leaves {percent} % of the gap's mean square{doubt}{held_out}"


def refuted(titles: Sequence[str], contradicting: Sequence[str], places: Sequence[str]) -> str:
    """That the best model fits, but predicts tests that contradict it worse, or others no better.

    ``places``: hold-outs on which most of the gap stays.
    """
    near = f"the nearest, {' with '.join(titles)}"
    if contradicting:
        return f". Without {near}, {' and '.join(contradicting)} would be predicted better from the other tests"
    if places:
        return f". On {' and '.join(places)} most of the gap stays with {near}"
    return f". Tests left out in turn are predicted no better with {near}"


def replaced(titles: Sequence[str], others: Sequence[str]) -> str:
    """That the best model cannot be told from others, if there are any, and that a term explains more without it."""
    doubt = f"cannot be told from {' or '.join(others)}, and" if others else "explains most of it, but"
    return f". The nearest, {' with '.join(titles)}, {doubt} a term explains more without it"


def contradicted(contradicting: Sequence[str], laws: int = 1) -> str:
    """That tests left out contradict the laws of main causes; empty if none does."""
    if not contradicting:
        return ""
    whose, they = ("Its law does", "it predicts") if laws == 1 else ("Their laws do", "they predict")
    return f" {whose} not hold throughout: from the other tests {they} {' and '.join(contradicting)} worse."


def unexplained(residuals: Residuals, unit: str) -> str:
    """The most significant residual test of a gap that no effect comes near."""
    test, p = residuals.tests[0], residuals.p_value
    bound = f"= {p:.1g}" if p > _SMALLEST else f"< {_SMALLEST:g}"
    return f": {test.description} ({test.rms:.2g} {unit} root mean square, p {bound})"
