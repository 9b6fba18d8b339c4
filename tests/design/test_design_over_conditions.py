"""The next test of a model whose parameters follow laws: under which condition."""

import json

import numpy as np
import pytest

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, write_campaign
from mofit.experimental_design.design_job import over_conditions
from mofit.models import Law, find_model, with_laws

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
    assert entry["sd"] < 0.8 * entry["sd_before"]


def test_conditions_of_the_default_space_are_those_of_the_laws():
    law = Law("c", "vertical_force", "quadratic", 3e3, 1e3, "N")
    model = with_laws(find_model("kelvin_voigt_damper"), [law])
    loads = (2e3, 2.4e3, 3e3, 3.5e3, 4e3)
    tests = [damper(load, 1).measurements[0].experiment for load in loads]
    assert over_conditions(model, tests[:2]) == {"vertical_force": [2e3, 2.4e3]}
    assert over_conditions(model, tests) == {"vertical_force": [2e3, 3e3, 4e3]}
    assert over_conditions(find_model("kelvin_voigt_damper"), tests) == {}


def test_a_plan_cannot_be_joined(run, tmp_path, capsys):
    files, _ = run
    (tmp_path / "plan.toml").write_text("")
    code = main(["design", str(files[0]), str(tmp_path / "plan.toml"), "--model", "kelvin_voigt_damper"])
    assert code == 2
    assert "a plan cannot be joined with other files" in capsys.readouterr().err
