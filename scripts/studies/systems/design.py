"""The sixty systems of a seed: a third with the right model, a third with a wrong one, a third with a ridge."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from systems import mechanics, process
from systems.family import Draw, Family, Loose, Split
from systems.simulate import TOLERANCE, Excitation, excitations, respond

FAMILIES = (*process.FAMILIES, *mechanics.FAMILIES)
THIRD = 20
#: One box in so many does not hold the truth.
NARROW = 6
#: A flaw is made twice as strong until the model misses by this much of the noise.
VISIBLE = 1.0
DOUBLINGS = 6
#: Standard deviation (of the logarithm where the scale is one) from which a parameter is not determined.
UNDETERMINED = 0.5
#: Weak prior of the information matrix, of one box wide, so that a ridge has a finite width.
PRIOR = 5.0
#: Relative step of the differences, and the tolerance that suits it.
STEP, COARSE = 1e-2, 1e-6
#: Most steps of the best fit of a wrong model.
FITS = 100


@dataclass(frozen=True)
class Case:
    """A family, and what is special."""

    number: int
    family: Family
    kind: str
    flaw: str = ""
    """Name of the extra that the model leaves out."""
    ridge: Split | Loose | None = None
    narrow: bool = False
    """Whether the box of one parameter does not hold the truth."""

    @property
    def label(self) -> str:
        """What the model lacks or cannot tell."""
        words = {extra: f"left out: {label}" for label, extra in self.family.flaws.items()}
        return words[self.flaw] if self.flaw else self.ridge.label if self.ridge else ""

    @property
    def name(self) -> str:
        """Unique name."""
        return f"{self.number:02d}_{self.family.name}_{self.kind}"


@dataclass(frozen=True)
class System:
    """A system with its data."""

    case: Case
    draw: Draw
    truth: dict[str, float]
    """Truth of the parameters of the user's model."""
    boxes: dict[str, tuple[float, float]]
    tests: list[Excitation]
    records: list[np.ndarray]
    """Noisy outputs (output, time) per test."""
    noise: np.ndarray
    """Standard deviation of every output."""
    misfit: float = 0.0
    """What the wrong model leaves at its best fit, as a multiple of the noise."""
    spread: dict[str, float] = field(default_factory=dict)
    """Expected standard deviation of every parameter: of the logarithm, or as a share of the box."""

    @property
    def tied(self) -> tuple[str, ...]:
        """Parameters that the data do not determine: by construction, or because too little of them shows."""
        built = self.case.ridge.tied if self.case.ridge else ()
        return tuple(name for name in self.truth if name in built or self.spread[name] > UNDETERMINED)


def cases() -> list[Case]:
    """The sixty, the same for every seed; the seed draws their numbers."""
    right = [(family, "right", "", None) for family in (*FAMILIES, *FAMILIES[::2])]
    wrong = [(family, "wrong", extra, None) for family in FAMILIES for extra in family.flaws.values()]
    ridges = [(family, "ridge", "", ridge) for family in FAMILIES for ridge in family.ridges]
    rows = [row for group in (right, wrong, ridges) for row in group[:THIRD]]
    return [Case(k + 1, *row, narrow=k % NARROW == NARROW - 1) for k, row in enumerate(rows)]


def make(case: Case, seed: int) -> System:
    """A system with its data.

    Parameters
    ----------
    case
        Family, and what is special.
    seed
        Decides every random draw.
    """
    rng = np.random.default_rng([seed, case.number])
    draw = case.family.draw(rng)
    truth = dict(draw.values)
    if isinstance(case.ridge, Loose):
        draw = case.ridge.change(draw)
        draw = replace(draw, constants={**draw.constants, **case.ridge.constants})
        truth = {**draw.values, **{name: draw.constants[name] for name in case.ridge.free}}
    if isinstance(case.ridge, Split):
        whole, part = truth.pop(case.ridge.of), rng.uniform(0.2, 0.8)
        other = whole * (1 - part) if case.ridge.how == "sum" else 1 / part
        truth |= dict(zip(case.ridge.tied, (whole * part, other), strict=True))
    tests = excitations(rng, case.family, draw)
    boxes = {name: box(rng, value, draw.boxes.get(name)) for name, value in truth.items()}
    if case.narrow:
        positive = [name for name in truth if name not in draw.boxes]
        name = positive[int(rng.integers(len(positive)))]
        boxes[name] = too_narrow(rng, truth[name])
    return measured(rng, case, draw, truth, boxes, tests)


def box(rng: np.random.Generator, value: float, half: float | None) -> tuple[float, float]:
    """Bounds as a user writes them: a decade or two about the truth, in round numbers."""
    if half is not None:
        return nice(value - half), nice(value + half)
    return nice(value / 10 ** rng.uniform(0.7, 2.3)), nice(value * 10 ** rng.uniform(0.7, 2.3))


def too_narrow(rng: np.random.Generator, value: float) -> tuple[float, float]:
    """Bounds that end before the truth, above or below."""
    near, far = rng.uniform(1.5, 4), 10 ** rng.uniform(1.5, 3)
    return (nice(value / far), nice(value / near)) if rng.random() < 0.5 else (nice(value * near), nice(value * far))


def nice(value: float) -> float:
    """Two significant digits."""
    return float(f"{value:.1e}")


def measured(rng, case, draw, truth, boxes, tests) -> System:
    """Simulate, make the flaw visible, and add the noise."""
    strength = draw.extras[case.flaw] if case.flaw else 0.0
    share = 10 ** rng.uniform(np.log10(0.003), np.log10(0.03))
    for _ in range(DOUBLINGS):
        clean = responses(case, draw, truth, tests, strength)
        noise = share * np.median([np.ptp(record, axis=1) for record in clean], axis=0)
        misfit, spread = expected(case, draw, truth, tests, clean, noise, boxes)
        if not case.flaw or misfit >= VISIBLE:
            break
        strength *= 2
    unit = [rng.normal(size=record.shape) for record in clean]
    records = [record + noise[:, None] * draws for record, draws in zip(clean, unit, strict=True)]
    return System(case, draw, truth, boxes, tests, records, noise, misfit, spread)


def responses(
    case: Case, draw: Draw, truth: dict[str, float], tests: list[Excitation], strength=0.0, tolerance=TOLERANCE
):
    """Outputs without noise of every test; the flaw has this strength."""
    values = {**draw.constants, **dict.fromkeys(draw.extras, 0.0), **truth}
    if isinstance(case.ridge, Split):
        one, two = (truth[name] for name in case.ridge.tied)
        values[case.ridge.of] = one + two if case.ridge.how == "sum" else one * two
    if case.flaw:
        values[case.flaw] = strength
    names = [name for name, _ in case.family.outputs]
    kept = case.ridge.outputs if isinstance(case.ridge, Loose) and case.ridge.outputs else names
    rows = [names.index(name) for name in kept]
    return [respond(case.family, draw, values, test, tolerance)[rows] for test in tests]


def best_fit(whitened, wanted, truth, linear: set[str]) -> np.ndarray:
    """Residual of the wrong model at its best fit, from the truth on; scale parameters by their logarithm."""
    names, start = list(truth), np.array(list(truth.values()))
    log = np.array([name not in linear for name in names])

    def residual(z):
        moved = np.where(log, start * np.exp(np.where(log, z, 0.0)), start + z * np.maximum(np.abs(start), 1e-12))
        return wanted - whitened(dict(zip(names, moved.tolist(), strict=True)))

    found = least_squares(residual, np.zeros(len(names)), x_scale="jac", diff_step=STEP, max_nfev=FITS)
    return found.fun


def expected(case, draw, truth, tests, clean, noise, boxes) -> tuple[float, dict[str, float]]:
    """Misfit of the model in multiples of the noise, and spread of every parameter in linear approximation."""

    def whitened(values):
        found = responses(case, draw, values, tests, tolerance=COARSE)
        return np.concatenate([(record / noise[:, None]).ravel() for record in found])

    middle, columns = whitened(truth), []
    for name, value in truth.items():
        change = STEP * (boxes[name][1] - boxes[name][0] if name in draw.boxes else value)
        up, down = (whitened({**truth, name: value + side * change}) for side in (1, -1))
        columns.append((up - down) / (2 * STEP))
    jacobian = np.array(columns).T
    wanted = np.concatenate([(record / noise[:, None]).ravel() for record in clean])
    gap = wanted - middle
    left = gap - jacobian @ np.linalg.lstsq(jacobian, gap, rcond=1e-8)[0]
    if case.flaw and np.sqrt(np.mean(left**2)) >= VISIBLE:  # parameters that move far may still hide it
        left = best_fit(whitened, wanted, truth, set(draw.boxes))
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(truth)) / PRIOR**2)
    spread = dict(zip(truth, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    return float(np.sqrt(np.mean(left**2))), spread
