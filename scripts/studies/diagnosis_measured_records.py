"""Sections of `diagnosis_measured.py` on records that do not repeat: pulses on a battery cell, and two tanks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import casadi as ca

from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.result import Diagnosis
from mofit.identification.settings import Settings
from mofit.models import Channel, Condition, Equations, Model, Symbols
from mofit.parameters import Parameter
from records_cases import battery, tanks

Report = Callable[[Diagnosis], list[str]]


class Resistor(Model):
    """U = U_0 + R_0 I; R_0 rises exponentially towards the empty cell."""

    name = "resistor"
    title = "cell without a branch"
    parameters = (
        Parameter("R_0", "ohm", 1e-3, 1.0, 0.03, "log", "series resistance at full charge"),
        battery.rise("r_0", "R_0"),
        Parameter("w", "1", 1e-2, 1.0, 0.1, "log", "charge over which the rise falls to 1/e"),
        Parameter("U_0", "V", 2.5, 4.5, 3.7, description="open-circuit voltage", per="test"),
    )
    conditions = (Condition("state_of_charge", "1"),)
    inputs = (Channel("current", "A"),)
    outputs = (Channel("voltage", "V"),)

    def equations(self, s: Symbols) -> Equations:
        """No state."""
        low = ca.exp((battery.LOWEST - s.state_of_charge) / s.w)
        return Equations(outputs={"voltage": s.U_0 + s.R_0 * (1 + s.r_0 * low) * s.current})


def cell(data: Path, seed: int, reported: Report) -> list[str]:
    """A series resistance alone on current pulses at nine charge states."""
    campaign = battery.campaign(data)
    pulses = tuple(one.name for one in campaign.measurements if one.name.endswith("Cell1"))
    found = diagnose(campaign, Resistor(), (), Settings(seed=seed, jobs=1), tests=pulses)
    return ["## Battery cell, series resistance alone", "", *reported(found), *_proposed(found)]


def overflow(data: Path, seed: int, reported: Report) -> list[str]:
    """Two equal tanks without their overflow."""
    found = diagnose(tanks.campaign(data), tanks.EqualTanks(), (), Settings(seed=seed, jobs=1))
    return ["## Cascaded tanks without overflow", "", *reported(found), *_proposed(found)]


def _proposed(found: Diagnosis) -> list[str]:
    """The term that is proposed, or why none is."""
    one = found.proposed
    return [one.sentence if one else f"No term is proposed: {found.proposed_reason or 'none was looked for'}.", ""]
