from dataclasses import replace

import numpy as np
import pytest

from mofit.identification.law_choice import alternatives, choose_laws, of_informed
from mofit.identification.law_fit import CellEstimates, fit_laws
from mofit.models import FREE
from mofit.parameters import Parameter

PARAMETERS = (Parameter("c", "N/m", 1e3, 1e6, 1e4, "log"), Parameter("F_0", "N", -1e3, 1e3, 0.0))
AT = np.array([(load, speed) for load in (2e3, 3e3, 4e3) for speed in (10.0, 20.0)])
X, V = (AT[:, 0] - 3e3) / 1e3, (AT[:, 1] - 15) / 5
COVARIANCE = np.array([[1e-4, 5e-3], [5e-3, 1.0]])


def cells(stiffness, offset, seed: int = 0) -> CellEstimates:
    noise = np.random.default_rng(seed).multivariate_normal([0, 0], COVARIANCE, len(AT))
    values = np.stack([stiffness * np.exp(noise[:, 0]), offset + noise[:, 1]], axis=1)
    covariance = np.tile(COVARIANCE, (len(AT), 1, 1))
    return CellEstimates(PARAMETERS, ("load", "speed"), ("N", "m/s"), AT, values, covariance)


def candidates(*forms: str):
    return {(one.name, name): forms for one in PARAMETERS for name in ("load", "speed")}


def test_a_shift_is_fitted_as_by_weighted_least_squares():
    own = cells(1e4 * np.ones(len(AT)), 50 + 20 * X)
    forms = {("c", "load"): FREE, ("c", "speed"): FREE, ("F_0", "load"): "linear", ("F_0", "speed"): "constant"}
    found = fit_laws(own, forms)
    centre, slope = np.polynomial.polynomial.polyfit(X, own.values[:, 1], 1)
    assert [found.values["F_0"], found.values["F_0_load"]] == pytest.approx([centre, slope], rel=1e-6)
    assert found.free == ("c",)
    rest = own.values[:, 1] - centre - slope * X
    assert found.chi_square == pytest.approx(rest @ rest)  # of a standard deviation of 1 N, c integrated out
    assert found.freedom == len(AT) - 2


def test_evidence_is_that_of_laplace():
    own = cells(1e4 * np.ones(len(AT)), 50 * np.ones(len(AT)))
    plain = dict.fromkeys(candidates(), "constant")
    one, other = fit_laws(own, plain), fit_laws(own, plain | {("F_0", "load"): "linear"})
    # conditional on c the variance of F_0 is less by their covariance; sum of X squared is 4
    precision = 4 / (1 - COVARIANCE[0, 1] ** 2 / COVARIANCE[0, 0])
    gain = (one.chi_square - other.chi_square) / 2 + np.log(2 * np.pi) / 2 - np.log(precision) / 2 - np.log(2e3)
    assert other.log_evidence - one.log_evidence == pytest.approx(gain, abs=1e-3)


def test_the_laws_are_recovered():
    own = cells(1e4 * (1 + 0.3 * X) * (1 - 0.1 * V), 50 - 40 * X + 25 * X**2)
    choices = candidates("constant", "linear", "quadratic", FREE)
    choices |= {key: ("constant", "linear", FREE) for key in choices if key[1] == "speed"}
    found = choose_laws(own, choices)
    assert found.forms == {
        ("c", "load"): "linear",
        ("c", "speed"): "linear",
        ("F_0", "load"): "quadratic",
        ("F_0", "speed"): "constant",
    }
    assert found.values["c_load"] == pytest.approx(0.3, abs=0.02)
    table = alternatives(own, found, choices)
    assert all(value < 1e-6 for row in table.values() for value in row.values())
    assert table["c", "load"]["linear"] == pytest.approx(0, abs=1e-6)


def test_shared_parameters_count_once_and_correlate_all_combinations():
    """Generalised least squares with the whole covariance: F_0 in every combination depends on the shared c."""
    slopes, inner, shared_variance = np.linspace(-40, 60, len(AT)), np.linspace(1, 4, len(AT)), 4e-4
    rng, truth = np.random.default_rng(1), 50 + 20 * X
    error = np.sqrt(shared_variance) * rng.normal()
    offset = truth + slopes * error + np.sqrt(inner) * rng.normal(size=len(AT))
    values = np.stack([np.full(len(AT), 1e4 * np.exp(error)), offset], axis=1)
    precision = np.array([
        [[k**2 / v + 1 / shared_variance / len(AT), -k / v], [-k / v, 1 / v]]
        for k, v in zip(slopes, inner, strict=True)
    ])  # fmt: skip
    covariance = np.tile(COVARIANCE, (len(AT), 1, 1))
    own = CellEstimates(
        PARAMETERS, ("load", "speed"), ("N", "m/s"), AT, values, covariance, ("c",), joint_precision=precision
    )
    forms = dict.fromkeys([("c", "load"), ("c", "speed")], "shared")
    found = fit_laws(own, forms | {("F_0", "load"): "linear", ("F_0", "speed"): "constant"})
    whole = np.diag(inner) + shared_variance * np.outer(slopes, slopes)
    design = np.stack([np.ones(len(AT)), X], axis=1)
    inverse = np.linalg.inv(whole)
    best = np.linalg.solve(design.T @ inverse @ design, design.T @ inverse @ offset)
    assert [found.values["F_0"], found.values["F_0_load"]] == pytest.approx(best, rel=1e-3)
    rest = offset - design @ best
    assert found.chi_square == pytest.approx(rest @ inverse @ rest, rel=1e-3)
    assert found.freedom == 1 + len(AT) - 3


def test_values_that_follow_no_law_are_free():
    jumps = np.array([1.0, 1.4, 0.7, 1.2, 1.3, 0.8])
    found = choose_laws(cells(1e4 * jumps, 50 * np.ones(len(AT))), candidates("constant", "linear", FREE))
    assert found.free == ("c",)
    assert "c" not in found.values


def test_what_combinations_hardly_know_has_no_value_for_each_unless_said():
    """A standard deviation of 500 N, of a range of 2000 N: 0.87 of that of a uniform distribution."""
    own, choices = cells(1e4 * np.ones(len(AT)), 500 * (-1) ** np.arange(len(AT))), candidates("constant", FREE)
    wide = replace(own, covariance=np.tile(np.diag([1e-4, 500.0**2]), (len(AT), 1, 1)))
    assert of_informed(own, choices, ()) == choices
    assert of_informed(wide, choices, ()) == choices | {("F_0", name): ("constant",) for name in ("load", "speed")}
    said = [("F_0", "load"), ("F_0", "speed")]
    assert of_informed(wide, choices, said) == choices
