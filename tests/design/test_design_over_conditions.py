"""The next test of a model whose parameters follow laws: under which condition."""

import json

import numpy as np
import pytest

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, write_campaign
from mofit.experimental_design.criteria import scales
from mofit.experimental_design.design_job import over_conditions
from mofit.experimental_design.target import target_of
from mofit.models import Law, find_model, with_laws
from mofit.parameters import ParameterSpace

#: tests under each load: the least is known at the highest
LOADS = {2e3: 3, 3e3: 2, 4e3: 1}
SPACE = """
[[tests]]
kind = "sine"
sample_rate = "50 Hz"
frequency = ["0.5 Hz", "1.5 Hz"]
amplitude = "10 mm"
duration = "4 s"
conditions = { vertical_force = ["2 kN", "2.5 kN", "3 kN", "3.5 kN", "4 kN"] }
"""


def damper(load: float, count: int) -> Campaign:
    rng, axis, measurements = np.random.default_rng(int(load)), np.arange(0, 4, 0.02), []
    for k in range(count):
        omega = 2 * np.pi * (0.5 + k)
        x, v = 0.01 * np.sin(omega * axis), 0.01 * omega * np.cos(omega * axis)
        force = 2e4 * (1 + 0.3 * (load - 3e3) / 1e3) * x + 500 * v + 5 + 2 * rng.normal(size=len(axis))
        test = Experiment(f"{0.5 + k:g}Hz", "sine", axis, {"displacement": x}, frequency=0.5 + k, amplitude=0.01)
        measurements.append(Measurement(test, {"force": force}, {"displacement": "m", "force": "N"}))
    return Campaign("damper", "simulated", {"vertical_force": load}, tuple(measurements))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    files = []
    for load, count in LOADS.items():
        files.append(folder / f"F{load:g}.nc")
        write_campaign(damper(load, count), files[-1])
    laws = ["--over", "vertical_force", "--law", "c=linear", "--law", "d=constant", "--law", "F_0=constant"]
    given = [*map(str, files), "--model", "kelvin_voigt_damper", "--fix", "p=0", *laws, "--no-sample", "--jobs", "1"]
    assert main(["identify", *given, "--out", str(folder / "run")]) == 3  # not sampled
    (folder / "space.toml").write_text(SPACE)
    return files, folder / "run"


def test_the_slope_of_a_law_asks_for_tests_at_both_ends(run, capsys):
    """With stiffnesses of 14 and 26 kN/m at the ends, n and m tests give the slope a variance of 26² / n + 14² / m.

    There are n = 3 and m = 1. Of two more tests one at each end gives the least, 26² / 4 + 14² / 2.
    """
    files, folder = run
    given = [*map(str, files), "--model", "kelvin_voigt_damper", "--run", str(folder), "--samples", "1", "--jobs", "1"]
    given += ["--space", str(folder.parent / "space.toml"), "--parameter", "c_vertical_force", "--budget", "8 s"]
    capsys.readouterr()
    code = main(["design", *given, "--json"])
    printed = capsys.readouterr()
    assert code == 0, printed.err
    found = json.loads(printed.out)
    assert sorted(test["conditions"]["vertical_force"] for test in found["design"]) == ["2 kN", "4 kN"]
    entry = found["parameters"]["c_vertical_force"]
    assert entry["sd"] < 0.85 * entry["sd_before"]


REPEATS = 400


def refitted(loads: list[tuple[float, float]]) -> float:
    """Scatter of c at 4 kN over refits of simulated tests, each under a load and at a frequency.

    Force is linear in c, c times slope, d, offset and p. A test counts without its first period, as identified.
    """
    rng, rows = np.random.default_rng(5), []
    for load, frequency in loads:
        axis = np.arange(1 / frequency, 4, 0.02)
        omega, place = 2 * np.pi * frequency, (load - 3e3) / 1e3
        x, v = 0.01 * np.sin(omega * axis), 0.01 * omega * np.cos(omega * axis)
        rows.append(np.stack([x, place * x, v, np.ones_like(x), np.abs(x) * x], axis=1))
    columns = np.concatenate(rows)
    force = columns @ [2e4, 6e3, 500, 5, 0] + 2 * rng.normal(size=(REPEATS, len(columns)))
    found = np.linalg.lstsq(columns, force.T, rcond=None)[0]
    return float(np.std(found[0] + found[1]))


def test_the_next_condition_for_a_target_is_that_by_which_refits_scatter_least_there(run, tmp_path, capsys):
    files, folder = run
    given = [*map(str, files), "--model", "kelvin_voigt_damper", "--run", str(folder), "--samples", "1", "--jobs", "1"]
    given += ["--space", str(folder.parent / "space.toml"), "--parameter", "c", "--budget", "4 s"]
    given += ["--target", "vertical_force=4000", "--out", str(tmp_path / "page.html")]
    capsys.readouterr()
    code = main(["design", *given, "--json"])
    printed = capsys.readouterr()
    assert code == 0, printed.err
    found = json.loads(printed.out)
    assert found["criterion"]["target"] == {"vertical_force": {"value": 4000.0, "unit": "N"}}

    known = [(load, 0.5 + k) for load, count in LOADS.items() for k in range(count)]
    (test,) = found["design"]
    frequency = float(test["frequency"].removesuffix(" Hz"))
    scatter = {load: refitted([*known, (load, frequency)]) for load in (2e3, 2.5e3, 3e3, 3.5e3, 4e3)}
    assert test["conditions"]["vertical_force"] == f"{min(scatter, key=scatter.__getitem__) / 1e3:g} kN"
    entry = found["parameters"]["c"]
    assert entry["sd_before"] == pytest.approx(refitted(known), rel=0.12)
    assert entry["sd"] == pytest.approx(min(scatter.values()), rel=0.12)
    assert entry["relative_sd"] == pytest.approx(entry["sd"] / 2.6e4, rel=0.01)
    assert "under vertical_force = 4000 N" in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--target", "load=4000"], "no parameter follows a law over it"),
        (["--target", "vertical_force=4000", "--parameter", "c_vertical_force"], "is a coefficient of a law"),
        (["--target", "vertical_force=4000", "--discriminate", "force_offset"], "is for parameters, not for effects"),
    ],
)
def test_a_target_that_cannot_be_aimed_at_is_refused(run, options, message, capsys):
    files, folder = run
    code = main(["design", *map(str, files), "--model", "kelvin_voigt_damper", "--run", str(folder), *options])
    assert code == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_every_law_has_a_value_at_the_target():
    """Scaled and shifted parameters, several laws of one, and one without a law, by their formulas."""
    laws = [
        Law("c", "vertical_force", "linear", 3e3, 1e3, "N"),
        Law("c", "temperature", "quadratic", 300.0, 20.0, "K"),
        Law("F_0", "vertical_force", "linear", 3e3, 1e3, "N"),
    ]
    model = with_laws(find_model("kelvin_voigt_damper"), laws)
    values = {"c": 2e4, "c_vertical_force": 0.3, "c_temperature": -0.1, "c_temperature_2": 0.2, "F_0": 5.0}
    values |= {"F_0_vertical_force": 2.0, "d": 500.0, "p": 1.0}
    space = ParameterSpace(model.parameters)
    samples = np.array([[values[name] for name in space.names]])
    target = target_of(model, space, samples, {"vertical_force": 3.5e3})
    assert target.conditions == {"vertical_force": 3.5e3, "temperature": 300.0}
    assert "temperature" in target.notes[0]
    row = dict(zip(space.names, target.rows[0, space.index("c")], strict=True))
    # c (1 + a / 2): as c itself, and a by a share of 0.15 / 1.15 per relative change
    assert row["c"] == pytest.approx(1)
    assert row["c_vertical_force"] == pytest.approx(0.15 / 1.15)
    assert row["c_temperature"] == row["c_temperature_2"] == row["d"] == 0
    assert target.rows[0, space.index("d")] == pytest.approx(np.eye(len(space))[space.index("d")])
    k = space.index("F_0")
    shift = target.rows[0, k] * target.size[0, k] / scales(space, samples)[0]
    assert shift[space.index("F_0_vertical_force")] == pytest.approx(0.5)


def test_conditions_of_the_default_space_are_those_of_the_laws():
    law = Law("c", "vertical_force", "quadratic", 3e3, 1e3, "N")
    model = with_laws(find_model("kelvin_voigt_damper"), [law])
    loads = (2e3, 2.4e3, 3e3, 3.5e3, 4e3)
    tests = [damper(load, 1).measurements[0].experiment for load in loads]
    assert over_conditions(model, tests[:2]) == {"vertical_force": [2e3, 2.4e3]}
    assert over_conditions(model, tests) == {"vertical_force": [2e3, 3e3, 4e3]}
    assert over_conditions(find_model("kelvin_voigt_damper"), tests) == {}
    assert over_conditions(model, tests, {"vertical_force": 3.2e3}) == {"vertical_force": [2e3, 3e3, 3.2e3, 4e3]}
    assert over_conditions(model, tests, {"vertical_force": 5e3}) == {"vertical_force": [2e3, 3e3, 4e3]}


def test_a_plan_cannot_be_joined(run, tmp_path, capsys):
    files, _ = run
    (tmp_path / "plan.toml").write_text("")
    code = main(["design", str(files[0]), str(tmp_path / "plan.toml"), "--model", "kelvin_voigt_damper"])
    assert code == 2
    assert "a plan cannot be joined with other files" in capsys.readouterr().err
