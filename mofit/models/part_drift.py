"""The drift of a part of a model over the campaign: of a force that it announces, of a parameter, or of the output."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca

from mofit.models.effect import Scaling
from mofit.models.extended_model import base_and_effects
from mofit.models.model import TIME, Applied, Apply, Condition, Equations, Model, Symbols
from mofit.parameters import Parameter, powers

#: what the name of such an effect begins with
DRIFT_PREFIX = "drift:"
#: the part that stands for the first output
OUTPUT = "output"
#: announced quantities that are a part's force, or stand for it
_PARTS = ("carcass_force", "spring_force", "maxwell_force", "damper_force", "hysteretic_force", "slip_stiffness")


class PartDrift(Scaling):
    r"""A part times :math:`1 + k \tau (1 - e^{-(t_0 + t) / \tau})`, with the test's start :math:`t_0`.

    The part changes at the rate :math:`k` as the campaign begins, and ends :math:`k \tau` off: an oil that warms, a
    rubber that softens; linear in time where :math:`\tau` is long. ``find_effect("drift:spring_force")`` is this effect
    on the spring force, ``drift:k`` on the parameter ``k``, ``drift:output`` on the first output. Fingerprint: follows
    the run order, on the lines that the part's own force is on.
    """

    family = "drift"
    inputs = (TIME,)
    conditions = (Condition("start_time", "s", None, "time since the campaign began"),)

    def __init__(self, part: str) -> None:
        self.name, self.on = DRIFT_PREFIX + part, (part,)
        self.title = f"drift of the {part.replace('_', ' ')}" if part in (*_PARTS, OUTPUT) else f"drift of {part}"
        self._rate, self._time = f"drift_{part}", f"drift_time_{part}"
        self.parameters = (
            Parameter(
                self._rate,
                "1/s",
                -1e-2,
                1e-2,
                -1e-4,
                description="relative change per time at first",
                neutral=0.0,
                scales=powers(time=-1),
            ),
            Parameter(
                self._time,
                "s",
                1.0,
                1e4,
                1e2,
                "log",
                "time in which the change fades",
                grid=(1e1, 1e2, 1e3),
                scales=powers(time=1),
            ),
        )

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Change of the part up to this moment."""
        rate, time = getattr(s, self._rate), getattr(s, self._time)
        return rate * time * (1 - ca.exp(-(s.start_time + s.time) / time))


def drifts_of(model: Model) -> tuple[str, ...]:
    """Names of the drifts that a model may have: of its parts, of what belongs to none, and of the output as a whole.

    Parts are forces that it announces. What belongs to none are parameters that keep their sign; a relative change of
    another means nothing where it is zero.
    """
    base, _ = base_and_effects(model)
    symbols, _ = _evaluated(base)
    parts = [name for name in _PARTS if name in symbols.quantities and _moves(base, name)]
    forces = ca.vertcat(*(symbols.quantities[name] for name in parts))
    others = [
        one.name for one in base.parameters if one.lower >= 0 and not _depends(forces, getattr(symbols, one.name))
    ]
    return tuple(DRIFT_PREFIX + name for name in (*parts, *others, OUTPUT))


def _moves(model: Model, part: str) -> bool:
    """Whether the outputs depend on an announced quantity: it may be for information only."""
    factor = ca.SX.sym("factor")
    _, equations = _evaluated(model, [(lambda _, value: Applied(value * factor), part)])
    return _depends(ca.vertcat(*equations.outputs.values(), *equations.derivatives.values()), factor)


def _depends(expression: ca.SX, symbol: ca.SX) -> bool:
    return bool(ca.depends_on(ca.SX(expression), symbol))


def _evaluated(model: Model, effects: Sequence[tuple[Apply, str]] = ()) -> tuple[Symbols, Equations]:
    symbols = Symbols({name: ca.SX.sym(name) for name in _names(model)}, effects=effects)
    return symbols, model.equations(symbols)


def _names(model: Model) -> Iterator[str]:
    for group in (model.states, model.inputs, model.parameters, model.conditions):
        yield from (item.name for item in group)
