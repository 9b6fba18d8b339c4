"""FMUs from the command line: identified, predicted, and told what is wrong."""

import json

import numpy as np
import pytest
from oscillator_fmu import build, position

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, write_campaign

TRUTH = {"k": 350.0, "d": 6.0, "m": 1.0}
NOISE = 2e-4
#: of the force in each test, N/s
SLOPES = (15.0, -10.0)
TIME = np.arange(301) / 100


def campaign(seed=0):
    """Responses to ramps of force from rest, with white noise."""
    rng, tests = np.random.default_rng(seed), []
    for number, slope in enumerate(SLOPES):
        exact = position(TIME, **TRUTH, slope=slope)
        experiment = Experiment(f"ramp {number}", "free", TIME, {"pull": slope * TIME}, {})
        units = {"pull": "N", "displacement": "m"}
        tests.append(Measurement(experiment, {"displacement": exact + NOISE * rng.normal(size=301)}, units))
    return Campaign("oscillator", "simulated", {}, tuple(tests))


def standard_deviations():
    """Of k and d, by the Fisher information of both tests with the noise known."""
    slopes = []
    for name in ("k", "d"):
        step = 1e-4 * TRUTH[name]
        ends = [position(TIME, **{**TRUTH, name: TRUTH[name] + side * step}, slope=1.0) for side in (1, -1)]
        slopes.append((ends[0] - ends[1]) / (2 * step))
    information = sum((slope / NOISE) ** 2 for slope in SLOPES) * (np.array(slopes) @ np.array(slopes).T)
    return dict(zip(("k", "d"), np.sqrt(np.diag(np.linalg.inv(information))), strict=True))


MAP = """
inputs.pull = "F"
outputs.displacement = "position"
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    build(tmp_path)
    (tmp_path / "map.toml").write_text(MAP)
    write_campaign(campaign(), tmp_path / "rig.nc")
    return tmp_path


@pytest.mark.slow
def test_an_fmu_is_identified_and_predicts(place, capsys):
    options = ["--model", "oscillator.fmu", "--map", "map.toml", "--free", "k,d"]
    found, _ = identified(capsys, "run", *options)
    assert set(found) == {"k", "d"}
    for name, sd in standard_deviations().items():
        assert abs(found[name]["mean"] - TRUTH[name]) < 4 * sd
        assert found[name]["sd"] == pytest.approx(sd, rel=0.2)
    write_campaign(campaign(seed=1), place / "again.nc")
    assert main(["predict", "run", "again.nc", "--json", *options]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["tests"]) == 2
    assert all(row["rms"] == pytest.approx(NOISE, rel=0.2) for row in told["tests"])  # nothing but the noise is left


EQUATIONS = """
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Oscillator(Model):
    name = "oscillator"
    parameters = (Parameter("k", "N/m", 40, 4000, 400, "log"), Parameter("d", "N s/m", 0.4, 40, 4, "log"))
    states = (Channel("x", "m"), Channel("v", "m/s"))
    inputs = (Channel("pull", "N"),)
    outputs = (Channel("displacement", "m"),)

    def equations(self, s):
        rates = {"x": s.v, "v": s.pull - s.d * s.v - s.k * s.x}
        return Equations(outputs={"displacement": s.x}, derivatives=rates)
"""


def identified(capsys, out, *options):
    code = main(["identify", "rig.nc", "--json", "--out", out, *options])
    told = capsys.readouterr()
    assert code == 0, told
    found = json.loads(told.out)
    (mode,) = found["modes"]
    return mode["parameters"], found


@pytest.mark.slow
def test_the_posterior_is_that_of_the_equations(place, capsys):
    (place / "equations.py").write_text(EQUATIONS)
    (place / "stepped.toml").write_text(f"interface = 'co-simulation'{MAP}")
    exact, _ = identified(capsys, "exact", "--model", "equations.py")
    for name in ("map.toml", "stepped.toml"):
        options = ("--model", "oscillator.fmu", "--map", name, "--free", "k,d")
        found, _ = identified(capsys, f"run of {name}", *options)
        for parameter, entry in exact.items():
            assert found[parameter]["mean"] == pytest.approx(entry["mean"], abs=0.05 * entry["sd"])
            assert found[parameter]["sd"] == pytest.approx(entry["sd"], rel=0.03)


@pytest.mark.slow
def test_a_run_with_a_hostile_fmu_ends_right(place, capsys):
    build(place, "HOSTILE", exchange=False)
    (place / "coarse.toml").write_text(f"steps = 4{MAP}")
    options = ("--model", "oscillator.fmu", "--map", "coarse.toml", "--free", "k,d", "--timeout", "1s", "--jobs", "2")
    found, told = identified(capsys, "hostile", *options)
    assert told["simulations"]["failed"] > 0
    for name, sd in standard_deviations().items():
        assert abs(found[name]["mean"] - TRUTH[name]) < 4 * sd
        assert found[name]["sd"] == pytest.approx(sd, rel=0.2)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--model", "maxwell_damper", "--free", "k"], "--free: say something of an FMU alone"),
        (["--model", "oscillator.fmu:map.toml", "--map", "map.toml"], "says what --map says"),
        (["--model", "oscillator.fmu", "--map", "absent.toml"], "there is no file 'absent.toml'"),
        (["--model", "oscillator.fmu", "--free", "K"], "has no parameter 'K'. Did you mean 'k'?"),
        (["--model", "oscillator.fmu"], "channel 'F'"),
        (["--model", "other.fmu"], "no such file"),
    ],
)
def test_what_cannot_be_is_told_and_nothing_written(place, capsys, options, told):
    before = sorted(place.iterdir())
    assert main(["identify", "rig.nc", *options]) == 2
    assert told in " ".join(capsys.readouterr().err.split())
    assert sorted(place.iterdir()) == before
