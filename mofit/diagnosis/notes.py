"""What to know of a result beside what it says."""

from __future__ import annotations

from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.shrinkage import Shrinkage
from mofit.diagnosis.whitened_data import WhitenedData


def at_ends(found: Attribution) -> tuple[str, ...]:
    """What to know of the best model's parameters that lie at the end of their range."""
    best = found.best.fitted
    bounds = zip(best.hypothesis.space.parameters, best.minimum.at_bound, strict=True)
    return tuple(
        f"{one.name} is at the end of its range, {one.lower if side < 0 else one.upper:.4g} {one.unit}: read what is "
        "named with care, or widen it with --bounds."
        for one, side in bounds
        if side and (one.lower if side < 0 else one.upper) != one.neutral
    )


def of_tests(found: Attribution, shrinkage: Shrinkage | None) -> tuple[str, ...]:
    """What to know of the shares where a test has values of its own."""
    layout = found.best.fitted.hypothesis.layout
    names = dict.fromkeys(name for (name, _), test in zip(layout.cells, layout.only_test, strict=True) if test >= 0)
    if shrinkage is None or not names:
        return ()
    return (f"What each test has of its own ({', '.join(names)}) is estimated from the held-out test itself.",)


def at_most(found: Attribution, rules: DiagnosisSettings) -> tuple[str, ...]:
    """What to know where the search ended although something is left."""
    tried = len(found.best.effects)
    if tried < rules.most_effects or found.best_residuals.p_value >= rules.residual_p_value:
        return ()
    return (f"No more than {tried} effects are tried at once, and more than noise is left: there may be one more.",)


def of_noise(observed: WhitenedData) -> tuple[str, ...]:
    """What to know of noise that the residual alone tells: nothing repeats that would tell it from a model error."""
    pairs = zip(observed.records, observed.noise_floors, strict=True)
    floors = [100 * floor for (_, _, w), floor in pairs if not w.periods]
    if not floors:
        return ()
    low, high = f"{min(floors):.2g}", f"{max(floors):.2g}"
    size = high if low == high else f"{low} to {high}"
    return (
        f"Of records that do not repeat, what past inputs do not predict of the residual counts as noise: {size} % of "
        "the output's range. Where the sensor has less, the model misses the rest.",
    )
