r"""Magic Formula coefficients that a run supports, from draws of what it identified.

At zero slip, camber and overpressure, with :math:`F'_{z0} = F_{z0} \lambda_{Fz0}`, :math:`q = F_z / F'_{z0}` and
:math:`d f_z = q - 1`:

.. math::
    K_{y\alpha} &= p_{Ky1} F'_{z0} \sin(p_{Ky4} \arctan(q / p_{Ky2})) \, \lambda_{Ky\alpha}
        && \text{(5.2: } p_{Ky4} = 2\text{)} \\
    \sigma_\alpha &= p_{Ty1} \sin(2 \arctan(q / p_{Ty2})) \, R_0 \lambda_{Fz0} \lambda_{\sigma\alpha} && \text{(5.2)} \\
    K_{x\kappa} &= F_z (p_{Kx1} + p_{Kx2} \, d f_z) \exp(p_{Kx3} \, d f_z) \, \lambda_{Kx\kappa} \\
    C_{y} &= C_{y0} (1 + p_{Cfy1} \, d f_z + p_{Cfy2} \, d f_z^2) && \text{(6.1; } C_x \text{ alike)}

A run at one load supports the first coefficient of each law, with the template's others; a run over load the first two.

References
----------
Pacejka, "Tire and Vehicle Dynamics", 2nd ed. (2006), section 4.3 (MF 5.2) and 3rd ed. (2012), section 4.3 (MF 6.1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.results.tir_file import Replacement, TirFile

#: a quantity at one or two loads [N]: the load, and its draws
AtLoads = Sequence[tuple[float, FloatArray]]


class UnsupportedError(Exception):
    """Why a coefficient cannot be replaced."""


@dataclass(frozen=True)
class TyreDraws:
    """What a run says of a tyre: draws (N,) of its parameters by name, and which of them are identified.

    ``loads``: that of a run at one load, or the nominal one and twice that of a run over load.
    """

    draws: Mapping[str, FloatArray]
    verdicts: Mapping[str, str]
    loads: tuple[float, ...]
    source: str

    def at_loads(self, name: str) -> AtLoads:
        """A parameter at the loads of the run.

        Raises
        ------
        UnsupportedError
            If the model has it not, or the run does not identify it.
        """
        names = [f"{name}_N", f"{name}_2N"] if f"{name}_N" in self.draws else [name]
        for one in names:
            if one not in self.draws:
                raise UnsupportedError(f"the model has no {name}")
            if (verdict := self.verdicts.get(one, "fixed")) != "identified":
                raise UnsupportedError(f"{one} is {verdict}")
        return [(load, self.draws[one]) for load, one in zip(self.loads, names, strict=True)]


def tir_replacements(tir: TirFile, tyre: TyreDraws) -> tuple[dict[str, Replacement], dict[str, str]]:
    """New numbers by key, and why other keys of the template stay as they are.

    Raises
    ------
    InputError
        If nothing can be replaced.
    """
    new: dict[str, Replacement] = {}
    kept: dict[str, str] = {}
    for keys, law, meaning in _laws(tir, tyre):
        there = [key for key in keys if tir.has(key)]
        try:
            if keys[0] not in there:
                raise UnsupportedError("the template does not have it")
            found = law()
            if missing := [key for key in found if key not in there]:
                raise UnsupportedError(f"the template has no {missing[0]} beside it")
        except UnsupportedError as reason:
            kept[keys[0]] = str(reason)
            continue
        for key, draws in found.items():
            low, value, high = np.quantile(draws, (0.05, 0.5, 0.95))
            text = (
                f"mofit: {key} from {meaning} of '{tyre.source}', 5 to 95 %: {low:.6g} to {high:.6g}, "
                f"was {tir.number(key):.6g}"
            )
            new[key] = Replacement(float(value), " ".join(text.encode("latin-1", "replace").decode("latin-1").split()))
    if not new:
        reasons = "; ".join(f"{key}: {reason}" for key, reason in kept.items())
        raise InputError.of(tir.where, f"the run supports none of its coefficients ({reasons})", "Identify more of it")
    return new, kept


def _laws(tir: TirFile, tyre: TyreDraws) -> list[tuple[tuple[str, ...], Callable[[], dict[str, FloatArray]], str]]:
    """Keys of every law, how they follow, and what from."""
    nominal, scaling = tir.number("FNOMIN"), tir.number("LFZO", 1.0)
    base, new = nominal * scaling, tir.version == "6.1"

    def cornering() -> dict[str, FloatArray]:
        exponent = tir.number("PKY4", 2.0) if new else 2.0
        amplitude = base * tir.number("LKY", 1.0)
        return _sine_law(tir, ("PKY1", "PKY2"), exponent, amplitude, base, tyre.at_loads("dF0"))

    def relaxation() -> dict[str, FloatArray]:
        if new:
            raise UnsupportedError("Magic Formula 6.1 takes the relaxation length from stiffnesses")
        stiffness = tyre.at_loads("c_y")
        lengths = [(load, slope / own) for (load, slope), (_, own) in zip(tyre.at_loads("dF0"), stiffness, strict=True)]
        amplitude = tir.number("UNLOADED_RADIUS") * scaling * tir.number("LSGAL", 1.0)
        return _sine_law(tir, ("PTY1", "PTY2"), 2.0, amplitude, base, lengths)

    def lateral() -> dict[str, FloatArray]:
        return _stiffness(tir, ("LATERAL_STIFFNESS", "PCFY1", "PCFY2"), base, tyre.at_loads("c_y"))

    def longitudinal() -> dict[str, FloatArray]:
        return _stiffness(tir, ("LONGITUDINAL_STIFFNESS", "PCFX1", "PCFX2"), base, tyre.at_loads("c_x"))

    return [
        (("PKY1", "PKY2"), cornering, "the cornering stiffness"),
        (("PTY1", "PTY2"), relaxation, "the relaxation length"),
        (("LATERAL_STIFFNESS", "PCFY1"), lateral, "the lateral stiffness"),
        (("PKX1", "PKX2"), lambda: _slip_stiffness(tir, base, tyre.at_loads("dF0_x")), "the slip stiffness"),
        (("LONGITUDINAL_STIFFNESS", "PCFX1"), longitudinal, "the longitudinal stiffness"),
    ]


def _sine_law(
    tir: TirFile, keys: tuple[str, str], exponent: float, amplitude: float, base: float, values: AtLoads
) -> dict[str, FloatArray]:
    """Coefficients of ``k1 * amplitude * sin(exponent * atan(F / (k2 * base)))``; their sign is the template's."""
    first, second = (tir.number(key) for key in keys)
    load, value = values[0]
    shape = np.sin(exponent * np.arctan(load / (second * base))) if second else 0.0
    if not first * shape:
        raise UnsupportedError(f"the template's {keys[0]} or {keys[1]} is 0, so its signs are not known")
    if len(values) == 1:
        return {keys[0]: np.sign(first * shape) * value / (amplitude * shape)}
    if exponent != 2:
        raise UnsupportedError(f"PKY4 is {exponent:g}: over load only 2 is supported")
    ratio = values[1][1] / value
    if np.any((ratio <= 0.5) | (ratio >= 2)):
        raise UnsupportedError(f"from one load to twice that it changes by {np.median(ratio):.3g}, not by 0.5 to 2")
    # sin(2 atan x) = 2 x / (1 + x^2)
    x = np.sqrt((2 - ratio) / (4 * ratio - 2))
    size = value * (1 + x**2) / (2 * x * amplitude)
    return {keys[0]: np.sign(first * shape) * size, keys[1]: load / (base * x)}


def _stiffness(tir: TirFile, keys: tuple[str, str, str], base: float, values: AtLoads) -> dict[str, FloatArray]:
    """Coefficients of ``k0 * (1 + k1 * dfz + k2 * dfz^2)``."""
    linear, square = (tir.number(key, 0.0) for key in keys[1:])
    changes = [load / base - 1 for load, _ in values]
    if len(values) == 1:
        return {keys[0]: values[0][1] / (1 + linear * changes[0] + square * changes[0] ** 2)}
    matrix = np.array([[1 + square * d**2, d] for d in changes])
    stiffness, slope = np.linalg.solve(matrix, np.array([draws for _, draws in values]))
    if not tir.has(keys[1]):
        raise UnsupportedError(f"the template has no {keys[1]} for its change with load")
    return {keys[0]: stiffness, keys[1]: slope / stiffness}


def _slip_stiffness(tir: TirFile, base: float, values: AtLoads) -> dict[str, FloatArray]:
    """Coefficients of ``F * (k1 + k2 * dfz) * exp(k3 * dfz)``."""
    second, third, scaling = tir.number("PKX2", 0.0), tir.number("PKX3", 0.0), tir.number("LKX", 1.0)
    changes = np.array([load / base - 1 for load, _ in values])
    parts = [draws / (load * np.exp(third * d) * scaling) for (load, draws), d in zip(values, changes, strict=True)]
    if len(values) == 1:
        return {"PKX1": parts[0] - second * changes[0]}
    first, slope = np.linalg.solve(np.array([[1.0, d] for d in changes]), np.array(parts))
    return {"PKX1": first, "PKX2": slope}
