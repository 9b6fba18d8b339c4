"""Terms that a sparse discrepancy may have, and the family of cause that each of them stands for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mofit._typing import FloatArray

#: rate, relative to its root mean square, within which a smooth sign turns
TURN = 0.05
STIFFNESS, DAMPING, FRICTION, LAG, RELAXATION = (
    "non-linear stiffness",
    "non-linear damping",
    "friction",
    "lag or delay",
    "relaxation",
)

Term = Callable[[FloatArray, FloatArray], FloatArray]
#: of deflection x and rate v
MOTION: Mapping[str, tuple[Term, str]] = {
    "1": (lambda x, v: np.ones_like(x), ""),
    "x": (lambda x, v: x, ""),
    "v": (lambda x, v: v, ""),
    "|x|": (lambda x, v: np.abs(x), STIFFNESS),
    "x²": (lambda x, v: x**2, STIFFNESS),
    "|x|x": (lambda x, v: np.abs(x) * x, STIFFNESS),
    "x³": (lambda x, v: x**3, STIFFNESS),
    "x⁵": (lambda x, v: x**5, STIFFNESS),
    "v²": (lambda x, v: v**2, DAMPING),
    "|v|v": (lambda x, v: np.abs(v) * v, DAMPING),
    "v³": (lambda x, v: v**3, DAMPING),
    "x²v": (lambda x, v: x**2 * v, DAMPING),
    "sign(v)": (lambda x, v: np.tanh(v / TURN), FRICTION),
}
#: rates of the signal that a filter or a delay acts on: the simulated output, or the input of a force
RATES = {"s'": LAG, "s''": LAG, "u'": LAG, "u''": LAG}
FAMILIES = {**{name: family for name, (_, family) in MOTION.items()}, **RATES}


def families(contributions: Mapping[str, float]) -> list[str]:
    """Families of the selected terms, the largest contribution first; terms without a family say nothing."""
    sums: dict[str, float] = {}
    for name, size in contributions.items():
        if family := FAMILIES.get(name, ""):
            sums[family] = sums.get(family, 0.0) + size**2
    return sorted(sums, key=lambda family: -sums[family])
