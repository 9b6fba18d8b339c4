"""Tyres under several loads whose spring a calibration stage fits: laws in the stage, and what a stage cannot give."""

import json

import pytest

from mofit.cli import main

PLAN = """
title = "tyre"
seed = {seed}
model = "kelvin_voigt_tyre"

[conditions]
vertical_force = "{load} N"
longitudinal_velocity = "60 km/h"

[parameters]
dF0 = "62 kN"
s_M = 0.13
F_M = "3100 N"
c_y = "{stiffness} N/m"
p_y = "-7.5 1/m"
d_y = "300 N s/m"

[noise.lateral_force]
sd = "10 N"

[[tests]]
name = "spring"
kind = "quasi_static"
sample_rate = "20 Hz"
amplitude = "15 mm"
ramp_rate = "2 mm/s"

[[tests]]
name = "sine"
kind = "sine"
sample_rate = "50 Hz"
frequency = "2 Hz"
amplitude = "2 deg"
periods = 6
"""
SPACE = """
[[tests]]
kind = "sine"
sample_rate = "50 Hz"
frequency = "1 Hz"
amplitude = "2 deg"
duration = "3 s"
conditions = { vertical_force = ["2 kN", "4 kN"] }
"""
FIXED = [part for name, value in (("dF0", 62e3), ("s_M", 0.13), ("F_M", 3100)) for part in ("--fix", f"{name}={value}")]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("tyres"), []
    for seed, load in enumerate((2000, 3000, 4000)):
        plan = folder / f"F{load}.toml"
        plan.write_text(PLAN.format(seed=seed, load=load, stiffness=12e4 * (1 + 0.2 * (load - 3000) / 1000)))
        found.append(str(folder / f"F{load}.nc"))
        assert main(["simulate", str(plan), "--out", found[-1]]) == 0
    return found


@pytest.mark.slow
def test_a_stage_is_fitted_with_the_laws(files, tmp_path, capsys):
    laws = ["--law", "c_y=linear", "--law", "others=constant"]
    given = [*files, "--model", "kelvin_voigt_tyre", *FIXED, "--over", "vertical_force", *laws]
    capsys.readouterr()
    code = main(["identify", *given, "--no-sample", "--jobs", "1", "--json", "--out", str(tmp_path / "run")])
    printed = capsys.readouterr()
    assert code == 3, printed.err  # not sampled
    found = json.loads(printed.out)["modes"][0]["parameters"]
    for name, truth in {"c_y": 12e4, "c_y_vertical_force": 0.2, "p_y": -7.5, "d_y": 300.0}.items():
        assert abs(found[name]["value"] - truth) < 4 * found[name]["sd"]
        assert found[name]["sd"] < 0.05 * abs(truth)
    # a design counts the stage's tests by the same laws
    (tmp_path / "space.toml").write_text(SPACE)
    given = [*files, "--model", "kelvin_voigt_tyre", "--run", str(tmp_path / "run"), "--samples", "1", "--jobs", "1"]
    given += ["--parameter", "d_y", "--target", "vertical_force=4000", "--budget", "3 s"]
    code = main(["design", *given, "--space", str(tmp_path / "space.toml"), "--json"])
    printed = capsys.readouterr()
    assert code == 0, printed.err
    proposed = json.loads(printed.out)["parameters"]["d_y"]
    assert 0 < proposed["sd"] < proposed["sd_before"] < 150.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["vertical_force", "--law", "c_y=free"], "--law c_y=free: calibrated by stage 'spring'"),
        (["vertical_force", "--law", "d_y=shared"], "beside shared parameters it would have a value for each"),
        (["specimen"], "c_y, p_y: calibrated by stage 'spring'"),
    ],
)
def test_a_value_per_combination_of_what_a_stage_calibrates_is_refused(files, options, message, tmp_path, capsys):
    given = [*files, "--model", "kelvin_voigt_tyre", *FIXED, "--over", *options, "--out", str(tmp_path / "run")]
    assert main(["identify", *given]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "run").exists()
