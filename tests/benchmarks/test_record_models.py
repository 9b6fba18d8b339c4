"""The models of the study of records: beside those written by hand for other programs, and in known states."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.models import Model, build_system
from mofit.problem import build_problem
from records_cases.battery import ChargedCell
from records_cases.drive import Drive
from records_cases.friction import DahlDamper
from records_cases.peers import cell_voltage, tank_level
from records_cases.silverbox import CubicOscillator
from records_cases.tanks import EqualTanks, OverflowingTanks, Tanks


def measured(channel: str, values: np.ndarray, step: float, output: str, **conditions: float) -> Measurement:
    """A test with that input, and an output that nothing depends on."""
    experiment = Experiment(
        "t", "free", step * np.arange(len(values)), {channel: values}, conditions, interpolation="linear"
    )
    units = {"pump": "V", "level": "V", "current": "A", "voltage": "V"}
    return Measurement(experiment, {output: np.linspace(0.0, 1.0, len(values))}, units)


def simulated(model: Model, test: Measurement, values: dict[str, float]) -> np.ndarray:
    """The output by mofit."""
    problem = build_problem(model, Campaign("c", "simulated", {}, (test,), units={"state_of_charge": "1"}))
    point = problem.space.to_unit([[values[name] for name in problem.space.names]])
    return problem.simulate(point)[0][0, :, 0]


def rates(model: Model, states: list[float], inputs: list[float], **values: float) -> np.ndarray:
    """Derivatives of the states, the parameters nominal where not given."""
    system = build_system(model)
    p = [values.get(one.name, one.nominal) for one in model.parameters]
    return np.array(system.rhs(states, inputs, p, [])).ravel()


def test_tanks_are_those_written_by_hand() -> None:
    test = measured("pump", np.repeat([4.0, 1.0, 6.0], 20), 4.0, "level")
    values = {"k_1": 0.05, "k_3": 0.06, "k_4": 0.04, "x_1": 6.0, "x_2": 5.0}
    assert simulated(EqualTanks(), test, values) == pytest.approx(tank_level(values, test), abs=1e-3)


def test_cell_is_that_written_by_hand() -> None:
    test = measured("current", np.repeat([0.0, -7.5, 0.0], 40), 0.1, "voltage", state_of_charge=0.2)
    values = {"R_0": 0.03, "R_1": 0.01, "tau": 2.0, "r_0": 0.2, "r_1": 1.5, "r_t": 0.5, "w": 0.05}
    model = ChargedCell()
    model.parameters = tuple(replace(one, per="campaign") for one in model.parameters)
    by_hand = cell_voltage({**values, "U_0 t": 3.7}, test)
    assert simulated(model, test, {**values, "U_0": 3.7}) == pytest.approx(by_hand, abs=1e-5)


def test_tanks_that_do_not_overflow_are_two_tanks() -> None:
    known = {"k_1": 0.05, "k_3": 0.06, "k_4": 0.04}
    plain = rates(Tanks(), [7.0, 3.0], [2.0], **known, k_2=0.08)
    assert plain == pytest.approx([0.08 - 0.05 * 7**0.5, 0.08 * 7**0.5 - 0.06 * 3**0.5], abs=1e-3)
    assert rates(OverflowingTanks(), [7.0, 3.0], [2.0], **known, g=1.6) == pytest.approx(plain)
    above = rates(OverflowingTanks(), [10.1, 3.0], [2.0], **known, g=1.0)
    assert above.sum() == pytest.approx(0.08 - 0.06 * 3**0.5, abs=1e-3)  # what the upper tank loses is in the lower one


def test_dahl_friction_is_built_up_at_1() -> None:
    assert rates(DahlDamper(), [1.0], [0.0, 0.1]) == pytest.approx([0.0], abs=1e-3)
    assert rates(DahlDamper(), [0.0], [0.0, 0.1], delta=1e-3) == pytest.approx([100.0])


def test_masses_are_at_rest_in_balance() -> None:
    cubic = {"k": 2.0, "k_2": 0.5, "k_3": 3.0}
    assert rates(CubicOscillator(), [0.1, 0.0], [2.0 * 1.08 * 0.1], **cubic) == pytest.approx([0.0, 0.0], abs=1e-9)
    drive = {"F_v": 200.0, "F_c": 20.0, "F_0": -3.0}
    assert rates(Drive(), [0.0, 0.1], [37.0], **drive) == pytest.approx([0.1, 0.0])
