import numpy as np
import pytest

from mofit.models import find_model
from mofit.problem import build_problem
from systems.design import cases, make, responses
from systems.files import campaign_of, write_files
from systems.judge import coverage, judged

CASES = cases()
#: one per family, most with a ridge: the parameters that the model adds are in its file, too
TRUE_MODELS = {case.family.name: case for case in CASES if case.kind != "wrong" and not case.narrow}.values()


def by_name(name):
    return next(case for case in CASES if case.name == name)


def answer(system, verdict="identified", shift=0.0, width=0.01):
    entries = {}
    for name, truth in system.truth.items():
        value = truth * (1 + shift)
        spread = width * abs(truth)
        points = {"q05": value - spread, "q50": value, "q95": value + spread}
        entries[name] = {"value": value, "verdict": verdict, **points}
    return {"converged": True, "green": True, "warnings": [], "modes": [{"probability": 1.0, "parameters": entries}]}


def test_a_third_is_right_a_third_wrong_a_third_has_a_ridge_and_a_sixth_a_narrow_box():
    kinds = [case.kind for case in CASES]
    assert [kinds.count(kind) for kind in ("right", "wrong", "ridge")] == [20, 20, 20]
    assert len({case.name for case in CASES}) == 60
    assert sum(case.narrow for case in CASES) == 10


@pytest.mark.slow
@pytest.mark.parametrize("case", TRUE_MODELS, ids=lambda case: case.name)
def test_model_file_and_independent_simulator_agree(case, tmp_path):
    system = make(case, 0)
    _, reference = write_files(system, tmp_path)
    problem = build_problem(find_model(reference), campaign_of(system))
    unit = problem.space.to_unit(np.array([[system.truth[name] for name in problem.space.names]]))
    clean = responses(case, system.draw, system.truth, system.tests)
    for found, true in zip(problem.simulate(unit), clean, strict=True):
        off = np.abs(found[0] - true.T) / system.noise
        assert np.sqrt(np.mean(off**2)) < 0.1


def test_a_lag_follows_its_closed_form():
    system = make(by_name("01_lag_right"), 3)
    (test,) = [test for test in system.tests if test.name == "sine_1"]
    (record,) = responses(system.case, system.draw, system.truth, [test])
    omega, tau = 2 * np.pi * test.frequency, system.truth["T"]
    turned, time = omega * tau, test.time
    steady = np.sin(omega * time) - turned * np.cos(omega * time) + turned * np.exp(-time / tau)
    expected = system.truth["K"] * test.amplitude * steady / (1 + turned**2)
    assert record[0] == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.ptp(expected))


def test_a_green_banner_on_the_truth_is_right():
    system = make(by_name("01_lag_right"), 0)
    row = judged(system, answer(system), 0)
    assert row["green"]
    assert not row["green_but_wrong"]
    assert coverage([{**row, "kind": "right", "narrow": False}]) == (2, 2)


@pytest.mark.parametrize(
    ("name", "shift"),
    [("01_lag_right", 0.05), ("21_lag_wrong", 0.0), ("42_rc_ridge", 0.0)],
    ids=["number", "model", "ridge"],
)
def test_a_green_banner_on_a_wrong_number_model_or_ridge_is_wrong(name, shift):
    system = make(by_name(name), 0)
    assert judged(system, answer(system, shift=shift), 0)["green_but_wrong"]


@pytest.mark.parametrize("change", [{"green": False}, {"converged": False, "green": False}])
def test_what_is_not_green_is_not_green_but_wrong(change):
    system = make(by_name("21_lag_wrong"), 0)
    assert not judged(system, {**answer(system), **change}, 0)["green_but_wrong"]
    assert not judged(system, answer(system), 3)["green_but_wrong"]
    assert not judged(system, None, None)["green_but_wrong"]
