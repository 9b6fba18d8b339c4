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


def slope(name: str, of: str) -> Parameter:
    """Of a logarithm over the charge state, from the middle to its ends: at most a factor of twenty."""
    return Parameter(name, "1", -3.0, 3.0, 0.0, description=of)


class ChargedCell(Model):
    """U = U_0 + R_0 I + U_1, tau U_1' = R_1 I - U_1; R_0, R_1 and tau are exponentials of a polynomial of the charge.

    The charge variable d runs from -1 (empty) to 1 (full); currents of discharge are negative.
    """

    name = "charged_cell"
    title = "cell with one RC branch"
    parameters = (
        Parameter("R_0", "ohm", 1e-3, 1.0, 0.03, "log", "series resistance at half charge"),
        Parameter("R_1", "ohm", 1e-4, 1.0, 0.01, "log", "resistance of the branch at half charge"),
        Parameter("tau", "s", 0.1, 100.0, 5.0, "log", "time constant of the branch at half charge"),
        slope("a_0", "slope of log R_0"),
        slope("b_0", "curvature of log R_0"),
        slope("a_1", "slope of log R_1"),
        slope("b_1", "curvature of log R_1"),
        slope("a_t", "slope of log tau"),
        Parameter("U_0", "V", 2.5, 4.5, 3.7, description="open-circuit voltage", per="test"),
    )
    conditions = (Condition("state_of_charge", "1"),)
    states = (Channel("polarisation", "V"),)
    inputs = (Channel("current", "A"),)
    outputs = (Channel("voltage", "V"),)

    def equations(self, s: Symbols) -> Equations:
        """One state; the charge does not change within a pulse of 21 mAh."""
        d = 2 * s.state_of_charge - 1
        series = s.R_0 * ca.exp(s.a_0 * d + s.b_0 * d**2)
        branch, tau = s.R_1 * ca.exp(s.a_1 * d + s.b_1 * d**2), s.tau * ca.exp(s.a_t * d)
        return Equations(
            outputs={"voltage": s.U_0 + series * s.current + s.polarisation},
            derivatives={"polarisation": (branch * s.current - s.polarisation) / tau},
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
