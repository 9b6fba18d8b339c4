"""What hides beside the linear spring and damper of a rig: forces of its deflection, its rate and their past."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mofit._typing import FloatArray

#: of a friction, in reaches: length over which it builds up, and the speed above which Stribeck's has fallen
LENGTH, FALL, EXCESS = 0.06, 0.15, 0.8
#: deflection in reaches at which a bump stop is met, and at which a sinh spring has stiffened
BUMP, SINH = 0.6, 0.35
#: relaxation times of one branch, and of a broad spectrum (three decades)
ONE, BROAD = (0.6,), tuple(np.geomspace(0.03, 30.0, 16))


@dataclass(frozen=True)
class Reach:
    """Largest deflection, rate and output of the rig without an effect, and the force of its spring there.

    In the tests of the campaign: what they show of an effect, records held out show by the same law.
    """

    deflection: float
    rate: float
    force: float
    output: float
    duration: float
    """Of the campaign."""


class Element:
    """Forces by the knobs of the cases; each is about the knob times the reach of the spring's force."""

    def __init__(self, knobs: Mapping[str, float], reach: Reach) -> None:
        self.k = {name: knobs.get(name, 0.0) for name in NAMES}
        self.reach = reach
        self.times: FloatArray = np.array(ONE if self.k["branch"] else BROAD if self.k["broad"] else ())
        self.share = (self.k["branch"] or self.k["broad"]) / max(len(self.times), 1)
        self.friction = self.k["dahl"] or self.k["stribeck"]
        self.states = len(self.times) + bool(self.friction)

    def spring(self, x: Any) -> Any:
        """Elastic force beside the spring."""
        k, a = self.k, x / self.reach.deflection
        force = k["cubic"] * a**3 + k["asymmetric"] * np.abs(a) + k["bump"] * np.maximum(a - BUMP, 0) / (1 - BUMP)
        if k["sinh"]:
            force = force + k["sinh"] * SINH * (np.sinh(a / SINH) - a / SINH) / np.cosh(1 / SINH) / SINH * 2
        return self.reach.force * force

    def damper(self, v: Any) -> Any:
        """Force of the rate beside the damper."""
        a = v / self.reach.rate
        size = np.abs(a)
        return self.reach.force * (self.k["quadratic"] * a * size + self.k["power"] * a * np.sqrt(size))

    def damper_slope(self, v: Any) -> Any:
        """Its derivative."""
        size = np.abs(v) / self.reach.rate
        slope = 2 * self.k["quadratic"] * size + 1.5 * self.k["power"] * np.sqrt(size)
        return self.reach.force / self.reach.rate * slope

    def film(self, x: Any, v: Any) -> Any:
        """Force of a damping that grows with the square of the deflection."""
        return self.reach.force * self.k["film"] * (x / self.reach.deflection) ** 2 * v / self.reach.rate

    def branches(self, z: Any) -> Any:
        """Force of relaxing branches, beside the spring."""
        return z[: len(self.times)].sum(axis=0)

    def rubbing(self, z: Any) -> Any:
        """Friction force, beside the damper."""
        return self.friction * self.reach.force * z[-1] if self.friction else 0.0

    def rates(self, deflection_rate: Any, v: Any, z: Any) -> Any:
        """Rates of the states: branch forces, then the share of the friction."""
        change, count = np.empty_like(z), len(self.times)
        stiffness = self.share * self.reach.force / self.reach.deflection
        if count:
            change[:count] = stiffness * deflection_rate - z[:count] / self.times[:, None]
        if self.friction:
            most = 1.0
            if self.k["stribeck"]:
                most = 1 + EXCESS * np.exp(-((v / (FALL * self.reach.rate)) ** 2))
            change[-1] = (v - np.abs(v) * z[-1] / most) / (LENGTH * self.reach.deflection)
        return change

    def spring_factor(self, clock: Any) -> Any:
        """Factor of the rig's own spring, which drifts with the time since the campaign began."""
        return 1 - self.k["force_drift"] * saturated(clock, self.reach.duration)

    def damper_factor(self, clock: Any) -> Any:
        """Factor of the rig's own damper, which becomes thinner as it warms."""
        return 1 - self.k["warm_damper"] * saturated(clock, self.reach.duration)


NAMES = (
    "cubic", "asymmetric", "bump", "sinh", "quadratic", "power", "dahl", "stribeck", "branch", "broad", "force_drift",
    "warm_damper", "film",
)  # fmt: skip


def saturated(clock: Any, duration: float) -> Any:
    """A change that has nearly ended when the campaign does."""
    return 1 - np.exp(-3 * np.maximum(clock, 0) / duration)
