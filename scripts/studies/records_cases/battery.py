"""Current pulses on battery cells: one law of resistance over the charge state, one open-circuit voltage per record.

The logger writes the current of the row before at the switch on, and no voltage for a second behind the switch off.
So a record ends with the pulse, and its second sample has the current of the third.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca

from mofit.data import Campaign, Measurement
from mofit.models import Channel, Condition, Equations, Model, Symbols
from mofit.parameters import Parameter
from records_cases.case import Case, imported

#: samples of a pulse, at 10 Hz: it ends at 10.0 s
PULSE = 100
#: charge state of the lowest record
LOWEST = 0.1


def rise(name: str, of: str) -> Parameter:
    """How much larger a quantity is at the lowest charge, relative to what it is at full charge."""
    return Parameter(name, "1", 1e-2, 1e2, 1.0, "log", f"{of} at a tenth of the charge, relative to full, less one")


class ChargedCell(Model):
    """U = U_0 + R_0 I + U_1, tau U_1' = R_1 I - U_1; R_0, R_1 and tau rise exponentially towards the empty cell.

    Chen and Rincon-Mora, "Accurate electrical battery model capable of predicting runtime and I-V performance", IEEE
    Transactions on Energy Conversion 21 (2006). Currents of discharge are negative.
    """

    name = "charged_cell"
    title = "cell with one RC branch"
    parameters = (
        Parameter("R_0", "ohm", 1e-3, 1.0, 0.03, "log", "series resistance at full charge"),
        Parameter("R_1", "ohm", 1e-4, 1.0, 0.01, "log", "resistance of the branch at full charge"),
        Parameter("tau", "s", 0.1, 100.0, 5.0, "log", "time constant of the branch at full charge"),
        rise("r_0", "R_0"),
        rise("r_1", "R_1"),
        rise("r_t", "tau"),
        Parameter("w", "1", 1e-2, 1.0, 0.1, "log", "charge over which the rises fall to 1/e"),
        Parameter("U_0", "V", 2.5, 4.5, 3.7, description="open-circuit voltage", per="test"),
    )
    conditions = (Condition("state_of_charge", "1"),)
    states = (Channel("polarisation", "V"),)
    inputs = (Channel("current", "A"),)
    outputs = (Channel("voltage", "V"),)

    def equations(self, s: Symbols) -> Equations:
        """One state; the charge does not change within a pulse of 21 mAh."""
        low = ca.exp((LOWEST - s.state_of_charge) / s.w)
        series, branch = s.R_0 * (1 + s.r_0 * low), s.R_1 * (1 + s.r_1 * low)
        return Equations(
            outputs={"voltage": s.U_0 + series * s.current + s.polarisation},
            derivatives={"polarisation": (branch * s.current - s.polarisation) / (s.tau * (1 + s.r_t * low))},
        )


def pulse(one: Measurement) -> Measurement:
    """The pulse alone, with the charge state that its name says in tenths."""
    experiment, current = one.experiment, one.experiment.inputs["current"][:PULSE].copy()
    current[1] = current[2]
    conditions = {**experiment.conditions, "state_of_charge": int(one.name.removeprefix("SoC")[0]) / 10}
    cut = replace(experiment, time=experiment.time[:PULSE], inputs={"current": current}, conditions=conditions)
    return replace(one, experiment=cut, outputs={"voltage": one.outputs["voltage"][:PULSE]})


def campaign(data: Path) -> Campaign:
    """All pulses."""
    found = imported(data, "battery_pulses")
    return replace(
        found, measurements=tuple(map(pulse, found.measurements)), units={**found.units, "state_of_charge": "1"}
    )


def _case(name: str, title: str, cells: str, evaluations: int | None = None) -> Case:
    return Case(
        name, title, ChargedCell, campaign, lambda test: test.endswith(cells), (), ("mV", 1e3),
        "converged within 30 s, at most 1 % NRMSD", evaluations,
    )  # fmt: skip


CASES = (
    _case("battery_cell", "Battery, one cell at nine charge states", "Cell1"),
    _case("battery", "Battery, six cells at nine charge states", "", 200),
)
