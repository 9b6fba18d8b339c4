"""Relaxation lengths and frequency responses against analytic limits, and the files that hold them."""

import csv

import numpy as np
import pytest
from kernel_response import transfer
from tyre_runs import SPEED, TRUE, tyre_run

from mofit.cli import main
from mofit.errors import InputError
from mofit.models import find_model
from mofit.prediction.frequency_response import LinearResponse
from mofit.prediction.relaxation import FREQUENCIES, tyre_responses
from mofit.results import write_result

ROLLING = {"longitudinal_velocity": SPEED}
EXACT = {"longitudinal_velocity": SPEED, "fictitious_velocity": 0.0}


@pytest.fixture(scope="module")
def run():
    return tyre_run("maxwell_tyre", [ROLLING, ROLLING, {"longitudinal_velocity": 10.0}])


def lengths_of(tree, name):
    responses = tyre_responses(tree, find_model(name))
    return list(zip(responses.points, responses.lengths(), strict=True))


@pytest.fixture(scope="module")
def exact():
    """Points and lengths of a tyre whose parameters are known."""
    return lengths_of(tyre_run("maxwell_tyre", [EXACT], sd=0.0), "maxwell_tyre")


def test_a_first_order_lag_has_its_own_time_constant():
    """And one that passes a part at once reaches 63 % sooner: T ln((1 - d) e) of a lag with the share d."""
    time = np.array([0.2, 0.05])
    minus, one, zero = -1 / time[:, None, None], 1 / time[:, None], np.zeros(2)
    lag = LinearResponse(minus, one, np.full((2, 1), 3.0), zero)
    share = 1 - np.exp(-1)
    assert lag.gain() == pytest.approx([3.0, 3.0])
    assert lag.lag() == pytest.approx(time)
    assert lag.rise_time(share) == pytest.approx(time, rel=1e-9)
    assert lag.transfer(np.array([4.0]))[:, 0] == pytest.approx(3 / (1 + 4j * time))
    passing = LinearResponse(minus, one, np.array([[0.9], [0.3]]), np.array([0.1, 0.7]))
    assert passing.rise_time(share) == pytest.approx([0.2 * np.log(0.9 * np.e), 0.0], rel=1e-9)
    assert passing.lag() == pytest.approx(time * [0.9, 0.3])


def test_an_unstable_system_never_settles():
    growing = LinearResponse(np.array([[[1.0]]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros(1))
    assert growing.rise_time(0.5) == [np.inf]


def test_lag_at_zero_slip_is_cornering_over_lateral_stiffness(run, exact):
    """Whatever the speed; with the interval of the quotient of two independent values of 1 %."""
    assert exact[0][1]["low frequency"] == pytest.approx([TRUE["dF0"] / TRUE["c_y"]] * 3, rel=3e-5)
    at_rest = [(point, own["low frequency"]) for point, own in lengths_of(run, "maxwell_tyre") if point.slip == 0]
    assert [point.conditions["longitudinal_velocity"] for point, _ in at_rest] == [SPEED, 10.0]
    for _, (low, middle, high) in at_rest:
        assert middle == pytest.approx(TRUE["dF0"] / TRUE["c_y"], rel=3e-3)
        assert (high - low) / middle == pytest.approx(2 * 1.645 * 0.01 * np.sqrt(2), rel=0.15)


def test_lag_with_slip_is_the_secant_slope_over_the_tangent_stiffness(exact):
    for point, own in exact[1:]:
        slip = np.tan(point.slip)
        sigma = slip / TRUE["s_M"]
        slope = TRUE["dF0"] / (1 + sigma * (sigma + TRUE["dF0"] * TRUE["s_M"] / TRUE["F_M"] - 2))
        # c_y (1 + p_y y) y = F, and its tangent
        y = min(np.roots([TRUE["c_y"] * TRUE["p_y"], TRUE["c_y"], -slope * slip]).real)
        tangent = TRUE["c_y"] * (1 + 2 * TRUE["p_y"] * y)
        # the wheel centre travels by 1 / cos of the way that the tyre rolls
        assert own["low frequency"][1] == pytest.approx(slope / tangent / np.cos(point.slip), rel=1e-6)


def test_the_step_length_of_a_slow_tyre_without_damper_is_the_lag(exact):
    """At 1 cm/s damper and branch carry nothing: the tyre is of first order."""
    slow = {"longitudinal_velocity": 0.01, "fictitious_velocity": 0.0}
    own = lengths_of(tyre_run("maxwell_tyre", [slow], sd=0.0), "maxwell_tyre")[0][1]
    assert own["63 % step response"][1] == pytest.approx(own["low frequency"][1], rel=1e-3)
    fast = exact[0][1]
    assert fast["63 % step response"][1] < 0.95 * fast["low frequency"][1]


def test_bode_is_the_linearised_transfer_function(run):
    responses = tyre_responses(tyre_run("maxwell_tyre", [ROLLING], sd=0.0), find_model("maxwell_tyre"))
    (_, gain, phase), *_ = responses.bode()
    for k in (0, 30, 60):
        expected = transfer(find_model("maxwell_tyre"), TRUE, 2 * np.pi * FREQUENCIES[k], ROLLING)
        assert gain[1, k] == pytest.approx(abs(expected), rel=1e-4)
        assert phase[1, k] == pytest.approx(np.degrees(np.angle(expected)), abs=1e-2)
    (_, gain, _), *_ = tyre_responses(run, find_model("maxwell_tyre")).bode()
    assert np.all(gain[0] < gain[1])
    assert np.all(gain[1] < gain[2])


def test_combined_tyre_has_a_length_in_either_direction():
    tree = tyre_run("maxwell_tyre_combined", [EXACT], sd=0.0)
    at_rest = {p.output: own["low frequency"][1] for p, own in lengths_of(tree, "maxwell_tyre_combined") if p.slip == 0}
    assert at_rest["lateral_force"] == pytest.approx(TRUE["dF0"] / TRUE["c_y"], rel=1e-4)
    assert at_rest["longitudinal_force"] == pytest.approx(TRUE["dF0_x"] / TRUE["c_x"], rel=1e-4)


def test_files_and_what_is_refused(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_result(run, tmp_path / "run")
    assert main(["export", "run", "--to", "relaxation"]) == 0
    rows = list(csv.DictReader((tmp_path / "maxwell_tyre_relaxation.csv").read_text().splitlines()))
    assert len(rows) == 2 * 5 * 2
    assert {row["definition"] for row in rows} == {"low frequency", "63 % step response"}
    assert all(float(row["q05"]) < float(row["q50"]) < float(row["q95"]) for row in rows)
    assert rows[0]["longitudinal_velocity [m/s]"] == repr(SPEED)
    assert main(["export", "run", "--to", "bode", "--out", "bode.csv"]) == 0
    assert len((tmp_path / "bode.csv").read_text().splitlines()) == 1 + 2 * len(FREQUENCIES)
    assert main(["export", "run", "--to", "bode", "--out", "bode.svg"]) == 0
    assert (tmp_path / "bode.svg").read_text().startswith("<?xml")
    assert main(["export", "run", "--to", "relaxation", "--out", "tyre.html"]) == 0
    page = (tmp_path / "tyre.html").read_text()
    assert "63 % step response" in page
    assert "Frequency response" in page
    capsys.readouterr()
    assert main(["export", "run", "--to", "bode", "--out", "bode.pdf"]) == 2
    assert "End it in .csv, .svg, .png" in capsys.readouterr().err
    assert not (tmp_path / "bode.pdf").exists()


def test_what_does_not_roll_or_has_no_state_has_no_length():
    with pytest.raises(InputError, match="no rolling tyre"):
        tyre_responses(tyre_run("quasi_static_spring", [{}]), find_model("quasi_static_spring"))
    with pytest.raises(InputError, match="has no state"):
        tyre_responses(tyre_run("tmeasy_curve", [ROLLING]), find_model("tmeasy_curve"))
