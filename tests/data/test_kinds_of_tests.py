"""Kinds of tests that a map may name: a free decay without an input, ramps, and the others."""

import numpy as np
import pytest

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, check_campaign, import_files, read_campaign
from mofit.data.campaign_tree import campaign_issues
from mofit.data.signals import analyse
from mofit.errors import InputError
from mofit.quantities import EXCITATION_KINDS

TIME = np.arange(2000) / 200
DECAY = np.exp(-0.4 * TIME) * np.cos(2 * np.pi * 3 * TIME)
MAP = """
title = "A pendulum"
[[tests]]
name = "decay"
file = "decay.csv"
procedure = "free"
time = { column = "t", unit = "s" }
channels.angle = { column = "phi", unit = "deg", role = "output" }
"""


@pytest.fixture
def rig(tmp_path):
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(TIME))
    np.savetxt(
        tmp_path / "decay.csv", np.column_stack([TIME, DECAY + noise]), delimiter=",", header="t,phi", comments=""
    )
    (tmp_path / "map.toml").write_text(MAP)
    return tmp_path


def test_a_free_decay_imports_and_passes_the_check(rig, capsys):
    assert main(["import", str(rig), "--map", str(rig / "map.toml"), "--out", str(rig / "a.nc")]) == 0
    assert main(["check", str(rig / "a.nc")]) == 0
    assert "error" not in capsys.readouterr().out
    campaign = read_campaign(rig / "a.nc")
    (test,) = campaign.measurements
    assert dict(test.experiment.inputs) == {}
    np.testing.assert_allclose(test.channel("angle"), np.deg2rad(DECAY), atol=1e-4)
    analysis = analyse(test)
    assert analysis.period is None
    assert analysis.noise_sd["angle"] == pytest.approx(np.deg2rad(1e-3), rel=0.2)
    assert campaign.hash() == import_files([], rig / "map.toml").hash()


def test_two_decays_and_a_driven_test_are_compared_without_harm(rig):
    text = MAP + MAP.split("[[tests]]")[1].join(["[[tests]]", ""]).replace('"decay"', '"again"')
    (rig / "map.toml").write_text(text)
    assert main(["import", str(rig), "--map", str(rig / "map.toml"), "--out", str(rig / "a.nc")]) == 0
    said = check_campaign(rig / "a.nc")
    assert {issue.severity for issue in said} == {"warning"}
    assert any("same" in issue.message or "copy" in issue.message for issue in said)


@pytest.mark.parametrize("kind", [kind for kind in EXCITATION_KINDS if kind != "free"])
def test_any_other_kind_needs_an_input(rig, kind):
    (rig / "map.toml").write_text(MAP.replace('"free"', f'"{kind}"'))
    with pytest.raises(InputError, match=r"no input channel\. Add one.*a free decay has none: procedure = 'free'"):
        import_files([], rig / "map.toml")


def test_a_free_test_still_needs_an_output(rig):
    (rig / "map.toml").write_text(MAP.replace('"output"', '"input"'))
    with pytest.raises(InputError, match="no output channel"):
        import_files([], rig / "map.toml")


def test_a_ramp_runs_straight_has_no_period_and_is_not_clipped():
    ramp = np.clip(TIME - 2, 0, 4)
    experiment = Experiment("ramp", "ramp", TIME, {"displacement": ramp})
    test = Measurement(experiment, {"force": 3 * ramp}, {"displacement": "m", "force": "N"})
    assert experiment.interpolation == "linear"
    assert analyse(test).period is None
    assert not campaign_issues(Campaign("Rig", "simulated", {}, (test,)))


def test_a_ramp_against_the_force_has_the_wrong_sign(tmp_path):
    from mofit.data import campaign_warnings

    ramp = np.clip(TIME - 2, 0, 4) / 100
    experiment = Experiment("ramp", "ramp", TIME, {"displacement": ramp})
    test = Measurement(experiment, {"force": -3 * ramp}, {"displacement": "m", "force": "N"})
    said = campaign_warnings(Campaign("Rig", "simulated", {}, (test,)))
    assert any("as if one of them had the opposite sign" in issue.message for issue in said)
    assert not any("clipped" in issue.message for issue in said)
