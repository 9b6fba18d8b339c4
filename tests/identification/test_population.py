"""Specimens: mean and spread over them, and the one that stands out."""

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement, joined
from mofit.errors import InputError
from mofit.identification.identify import identify
from mofit.identification.law_fit import CellEstimates
from mofit.identification.population import outliers, populations
from mofit.identification.settings import Settings
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter
from mofit.results import summary


class Line(Model):
    """y = k x + b."""

    name = "line"
    parameters = (Parameter("k", "N/m", 0.1, 10.0, 1.0, "log"), Parameter("b", "N", -10.0, 10.0, 0.0))
    inputs = (Channel("x", "m"),)
    outputs = (Channel("y", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"y": s.k * s.x + s.b})


STIFFNESSES = (2.0, 2.1, 1.9, 2.05, 1.95, 3.5)


def specimen(number: int, k: float) -> Campaign:
    rng, time = np.random.default_rng(number), 0.01 * np.arange(200)
    x = np.sin(time**2 + number)
    y = k * x + 1.0 + 0.05 * rng.normal(size=len(time))
    test = Measurement(Experiment("pull", "free", time, {"x": x}), {"y": y}, {"x": "m", "y": "N"})
    return Campaign("springs", "simulated", {}, (test,))


def fleet(values) -> Campaign:
    return joined([specimen(number, k) for number, k in enumerate(values)], [f"s{n}" for n in range(len(values))])


def drawn(seed: int, count: int, spread: float, sd: float = 0.5) -> CellEstimates:
    rng = np.random.default_rng(seed)
    values = 3 + spread * rng.normal(size=(count, 1)) + sd * rng.normal(size=(count, 1))
    covariance = np.full((count, 1, 1), sd**2)
    own = Parameter("b", "N", -10.0, 10.0, 0.0)
    return CellEstimates((own,), ("specimen",), ("1",), np.arange(count)[:, None], values, covariance)


def test_mean_and_spread_lie_in_their_intervals():
    inside = []
    for seed in range(60):
        (one,) = populations(drawn(seed, 30, spread=1.0))
        inside.append((one.mean_band[0] < 3 < one.mean_band[1], one.spread_band[0] < 1.0 < one.spread_band[1]))
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.9) < 0.116)  # three standard errors


def test_the_evidence_tells_a_spread_from_none():
    gains = [[populations(drawn(seed, 30, spread))[0].log_evidence for seed in range(20)] for spread in (0.0, 1.0)]
    assert np.mean(np.array(gains[0]) < 0) > 0.9
    assert np.all(np.array(gains[1]) > 0)


def test_a_specimen_is_named_by_mistake_in_one_fleet_of_a_hundred():
    for spread in (0.0, 1.0):
        named = [bool(outliers(drawn(seed, 8, spread))) for seed in range(200)]
        assert np.mean(named) < 0.01 + 3 * np.sqrt(0.01 / 200)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    out = tmp_path_factory.mktemp("fleet") / "run"
    return identify(fleet(STIFFNESSES), Line(), Settings(over=("specimen",), sample=False, jobs=1), out=out)


def test_a_fleet_gives_a_population_and_the_specimen_that_stands_out(run):
    folder, tree = run
    found = summary(tree, folder)
    assert {row["parameter"]: row["law"] for row in found["laws"]["laws"]} == {"k": "pooled", "b": "constant"}
    assert [(one["specimen"], one["parameter"]) for one in found["laws"]["outliers"]] == [("s5", "k")]
    assert any("Specimen s5 stands out: its k" in finding["text"] for finding in found["findings"])
    values = tree["modes/m1/scoped"].dataset["value"].values[:, 0]
    assert values == pytest.approx(STIFFNESSES, rel=0.01)
    assert found["modes"][0]["parameters"]["b"]["value"] == pytest.approx(1.0, abs=0.02)
    assert "Stands out" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_all_parameters_may_differ_between_specimens(tmp_path):
    settings = Settings(over=("specimen",), laws={"k": "pooled", "b": "pooled"}, sample=False, jobs=1)
    _, tree = identify(fleet(STIFFNESSES[:5]), Line(), settings, out=tmp_path / "run")
    mode = tree["modes/m1"].dataset
    assert list(mode["parameter"].values) == ["k_mean", "k_spread", "b_mean", "b_spread"]
    assert mode["value"].sel(parameter="k_mean").item() == pytest.approx(2.0, rel=0.02)
    assert mode["value"].sel(parameter="k_spread").item() == pytest.approx(np.std(np.log(STIFFNESSES[:5])), rel=0.2)
    assert mode["value"].sel(parameter="b_mean").item() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("count", "more", "message"),
    [
        (2, {}, "there are 2 specimens"),
        (3, {"laws": {"k": "linear"}}, "specimens have no order"),
        (3, {"laws": {"c": "pooled"}}, "no free parameter 'c'"),
    ],
)
def test_what_does_not_suit_specimens_is_refused(count, more, message, tmp_path):
    settings = Settings(over=("specimen",), sample=False, jobs=1, **more)
    with pytest.raises(InputError, match=message):
        identify(fleet(STIFFNESSES[:count]), Line(), settings, out=tmp_path / "run")


def test_a_specimen_that_stands_out_widens_no_population():
    cells = drawn(3, 60, spread=1.0)
    values = cells.values.copy()
    values[17, 0] += 12.0
    odd = CellEstimates(cells.parameters, cells.conditions, cells.units, cells.at, values, cells.covariance)
    named = outliers(odd)
    assert [one.specimen for one in named] == [17]
    (whole,), (rest,) = populations(odd), populations(odd, named)
    assert rest.spread_band[0] < 1.0 < rest.spread_band[1] < whole.spread_band[0]
