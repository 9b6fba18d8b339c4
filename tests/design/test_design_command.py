"""`mofit design` as a user meets it: on a branch whose best test is known."""

import json
from pathlib import Path

import numpy as np
import pytest
from published_schemas import violations

from mofit.cli import main
from mofit.data import write_campaign
from mofit.simulation.virtual_rig.plan import read_plan
from mofit.simulation.virtual_rig.rig import run_plan

BRANCH = """
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Branch(Model):
    name = "branch"
    parameters = (
        Parameter("c", "N/m", 1e3, 6e4, 2e4, "log"),
        Parameter("d", "N s/m", 500.0, 6e4, 8e3, "log"),
    )
    states = (Channel("inner", "m"),)
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        force = s.quantity("spring_force", s.c * (s.displacement - s.inner))
        return Equations(outputs={"force": force}, derivatives={"inner": s.c * (s.displacement - s.inner) / s.d})
"""

PLAN = """
title = "branch rig"
model = "MODEL"
seed = 3
pause = "5 s"

[noise.force]
sd = "NOISE"

[[tests]]
name = "fast"
kind = "sine"
sample_rate = "100 Hz"
amplitude = "10 mm"
frequency = "8 Hz"
duration = "10 s"
"""

SPACE = """
overhead = "5 s"

[limits]
amplitude = "10 mm"
rate = "300 mm/s"

[limits.outputs]
force = "199 N"

[defaults]
sample_rate = "100 Hz"
duration = "20 s"

[[tests]]
kind = "sine"
frequency = { from = "0.1 Hz", to = "6.4 Hz", count = 7 }
amplitude = ["5 mm", "10 mm", "20 mm"]

[[tests]]
kind = "multisine"
frequency = "0.2 Hz"
lines = [1, 2, 3]
amplitude = "5 mm"
"""


@pytest.fixture
def rig(tmp_path):
    """Files of the rig; ``rig("3 N")`` is the plan with that noise."""
    (tmp_path / "branch.py").write_text(BRANCH)
    (tmp_path / "space.toml").write_text(SPACE)

    def plan(noise="3 N"):
        text = PLAN.replace("MODEL", f"{tmp_path / 'branch.py'}:Branch").replace("NOISE", noise)
        (tmp_path / "rig.toml").write_text(text)
        return tmp_path / "rig.toml"

    return plan


def design(capsys, *arguments, samples=3):
    code = main(["design", *map(str, arguments), "--samples", str(samples), "--jobs", "1", "--json"])
    printed = capsys.readouterr()
    if not printed.out:
        return code, printed.err
    found = json.loads(printed.out)
    assert not violations(found)
    return code, found


def test_the_next_test_is_the_one_that_theory_names(rig, tmp_path, capsys):
    """FILE's sine shows the stiffness; the damping shows most at c / (2 pi d), about 0.4 Hz."""
    code, found = design(
        capsys, rig(), "--space", tmp_path / "space.toml", "--parameter", "d", "--budget", "25 s",
        "--plan", tmp_path / "next.toml", "--out", tmp_path / "page.html",
    )  # fmt: skip
    assert code == 0
    (test,) = found["design"]
    assert (test["frequency"], test["amplitude"], test["seconds"]) == ("0.4 Hz", "10 mm", 25.0)
    assert found["exhaustive"]
    entry = found["parameters"]["d"]
    assert found["expected"] == {"d": entry["sd"]}
    assert entry["sd"] < entry["sd_before"] / 3
    # the criterion of a single parameter is its standard deviation
    assert found["criterion"]["name"] == "c"
    assert found["criterion"]["before"] == entry["relative_sd_before"]
    assert found["criterion"]["after"] == entry["relative_sd"]
    assert f"{100 * entry['relative_sd']:.3g} % after" in (tmp_path / "page.html").read_text()
    # 20 mm breaks the amplitude, 6.4 Hz at 10 mm the rate; 10 mm at high frequency the force
    assert found["infeasible"] == {"amplitude": 7, "rate": 1, "force": 3}
    page = (tmp_path / "page.html").read_text()
    assert "sine_0_4Hz_10mm_20s" in page
    assert "http" not in page.split("</head>")[1].replace("http://www.w3.org", "")
    plan = read_plan(tmp_path / "next.toml")
    campaign = run_plan(plan)
    assert campaign.tests == ("sine_0_4Hz_10mm_20s",)
    assert np.ptp(campaign.measurements[0].experiment.inputs["displacement"]) == pytest.approx(0.02, rel=1e-3)


def test_the_promise_is_kept_by_estimates(rig, tmp_path, capsys):
    """Predicted standard deviation against least squares on simulated repeats."""
    from mofit.models import find_model
    from mofit.optimize import merge, refine
    from mofit.problem import build_problem

    file = rig()
    _, found = design(capsys, file, "--space", tmp_path / "space.toml", "--parameter", "d", "--budget", "25 s",
                     "--plan", tmp_path / "next.toml", samples=1)  # fmt: skip
    whole = read_plan(file)
    whole = whole.model_copy(update={"tests": (*whole.tests, *read_plan(tmp_path / "next.toml").tests)})
    model = find_model(whole.model)
    estimates = []
    for seed in range(30):
        problem = build_problem(model, run_plan(whole.model_copy(update={"seed": seed})))
        start = problem.space.to_unit(problem.space.nominal)[None]
        problem = problem.near(start, np.full(2, 0.02)).with_noise_at(start[0])
        estimates.append(problem.space.from_unit(merge(refine(problem.evaluate, start))[0].point)[1])
    # 30 repeats: 13 % standard error
    assert np.std(estimates, ddof=1) == pytest.approx(found["expected"]["d"], rel=0.4)


def test_time_is_shared_between_tests_and_less_of_it_tells_less(rig, tmp_path, capsys):
    code, found = design(
        capsys, rig(), "--space", tmp_path / "space.toml", "--criterion", "A", "--ignore-existing-tests", "--budget", 80
    )
    assert code == 0
    assert sum(test["times"] for test in found["design"]) == 3
    assert found["seconds"] == 75.0
    values = [point["value"] for point in found["pareto"]]
    assert values == sorted(values, reverse=True)
    assert found["pareto"][-1]["value"] == pytest.approx(found["criterion"]["after"], rel=0.05)
    again = design(
        capsys, rig(), "--space", tmp_path / "space.toml", "--criterion", "A", "--ignore-existing-tests", "--budget", 80
    )
    assert again == (code, found)


def test_what_stays_not_identifiable_has_exit_code_4(rig, tmp_path, capsys):
    space = tmp_path / "space.toml"
    code, found = design(capsys, rig("20 kN"), "--space", space, "--parameter", "d", "--budget", "25 s")
    assert code == 4
    assert "d stays" in found["not_identifiable"][0]
    assert found["design"]


def test_an_effect_is_discriminated_from_none(rig, tmp_path, capsys):
    options = ("--space", tmp_path / "space.toml", "--budget", "25 s")
    code, found = design(capsys, rig(), *options, "--discriminate", "force_offset")
    assert code == 0
    assert found["criterion"]["name"] == "T"
    assert found["criterion"]["after"] > found["criterion"]["before"] > 0
    assert found["singles"][0]["value"] == max(single["value"] for single in found["singles"])


def test_effects_that_parameters_imitate_cannot_be_discriminated(rig, tmp_path, capsys):
    """A gain of the force is a stiffer and more damped branch."""
    options = ("--space", tmp_path / "space.toml", "--budget", "25 s")
    code, found = design(capsys, rig(), *options, "--discriminate", "force_gain", "--discriminate", "force_offset")
    assert code == 4
    assert found["criterion"]["after"] < 1
    assert "does not discriminate force_gain and force_offset" in found["not_identifiable"][0]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--parameter", "dd"], "Did you mean 'd'"),
        (["--criterion", "B"], "criterion"),
        (["--budget", "10 s"], "shortest candidate takes 25 s"),
        (["--budget", "10 kg"], "--budget"),
        (["--robust", "median"], "--robust"),
        (["--at", "d=1"], "--at d"),
        (["--plan", "absent/next.toml"], "folder"),
        (["--discriminate", "force_gian"], "force_gain"),
    ],
)
def test_mistakes_are_named_and_nothing_is_written(rig, tmp_path, capsys, monkeypatch, arguments, text):
    monkeypatch.chdir(tmp_path)
    file = rig()
    before = sorted(Path().rglob("*.*"))
    code, message = design(capsys, file, "--space", tmp_path / "space.toml", *arguments)
    assert code == 2
    assert text in message
    assert [path for path in sorted(Path().rglob("*.*")) if "__pycache__" not in str(path)] == [
        path for path in before if "__pycache__" not in str(path)
    ]


def test_a_campaign_and_an_effect_of_its_model_give_a_plan_of_the_rig(rig, tmp_path, capsys):
    file, measured, plan = rig(), tmp_path / "measured.nc", tmp_path / "next.toml"
    write_campaign(run_plan(read_plan(file)), measured)
    options = ("--model", f"{tmp_path / 'branch.py'}:Branch", "--effect", "force_offset", "--budget", "25 s")
    code, found = design(capsys, measured, *options, "--plan", plan, samples=1)
    assert code == 0
    assert list(found["parameters"])[:2] == ["c", "d"]
    written = read_plan(plan)
    assert set(written.parameters) == {"c", "d"}
    assert [test.name for test in written.tests] == [test["name"] for test in found["design"]]
