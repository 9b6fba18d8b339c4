"""The blind test from end to end, with as few campaigns as it can have."""

import json
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from benchmarks.withheld_effects import check, diagnose_blindly
from benchmarks.withheld_speed import measured, row

COUNTS = {"none": 1, "per-effect": 0, "unmodelled": 0, "pairs": 0, "variants": 0}


@pytest.mark.slow
def test_campaigns_are_made_diagnosed_and_scored_once(tmp_path: Path) -> None:
    report = check(COUNTS, 5, 1, tmp_path, "a test")
    figures = json.loads((report / "figures.json").read_text())
    assert figures["campaigns"]["none"] == 1
    assert figures["none"]["false_alarms"]["hits"] == 0
    assert figures["not_diagnosed"] == 0
    assert "Made by `make bench NAME=withheld_effects`: a test." in (report / "README.md").read_text()
    (result,) = report.parent.glob("first/*.json")
    before = result.stat().st_mtime_ns
    assert check(COUNTS, 5, 1, tmp_path, "a test") == report
    assert result.stat().st_mtime_ns == before
    (campaign,) = (report.parents[1] / "campaigns").glob("*.nc")
    diagnose_blindly(campaign, "delay", tmp_path)
    candidates = json.loads((tmp_path / f"{campaign.stem}.json").read_text())["candidates"]
    names = {candidate["name"] for candidate in candidates}
    assert "delay" not in names
    assert {"drift", "contact_patch_lag"} < names


@pytest.mark.slow
def test_the_papers_sines_alone_are_a_check_of_their_own(tmp_path: Path) -> None:
    report = check(COUNTS, 5, 1, tmp_path, "a test", paper=True)
    assert json.loads((report / "figures.json").read_text())["campaigns"]["none"] == 1
    assert "Made by `make bench NAME=withheld_effects_paper`: a test." in (report / "README.md").read_text()
    place = report.parents[1]
    assert place.name == "withheld_effects_paper-5"
    (campaign,) = (place / "campaigns").glob("*.nc")
    with netCDF4.Dataset(campaign) as file:
        assert sum("sine" in name for name in file.groups) == 9
    assert not (report.parent / "without").exists()


@pytest.mark.slow
def test_seconds_are_those_of_the_command_and_kept(tmp_path: Path) -> None:
    alone, every, weighted = measured(COUNTS, 5, tmp_path / "speed")
    assert (alone["campaigns"], every["campaigns"], weighted["campaigns"]) == ("none", "all", "all, weighted")
    (seconds,) = json.loads((tmp_path / "speed" / "seconds.json").read_text()).values()
    assert alone["longest_s"] == pytest.approx(seconds, abs=0.05)
    (result,) = (tmp_path / "speed" / "results").glob("*.json")
    assert json.loads(result.read_text())["verdict"] == "none"
    assert measured(COUNTS, 5, tmp_path / "speed") == [alone, every, weighted]


def test_quantiles_follow_the_weights() -> None:
    seconds = np.array([40.0, 3.0, 4.0, 9.0])
    alike = row("all", seconds, np.ones(4))
    assert [alike[key] for key in ("median_s", "90_%_s", "longest_s")] == [4.0, 40.0, 40.0]
    assert [alike[f"within_{limit}_s_%"] for limit in (5, 10, 30)] == [50.0, 75.0, 75.0]
    few_slow = row("all, weighted", seconds, np.array([0.02, 0.5, 0.1, 0.38]))
    assert [few_slow[key] for key in ("median_s", "90_%_s", "longest_s")] == [3.0, 9.0, 40.0]
    assert few_slow["within_10_s_%"] == 98.0
