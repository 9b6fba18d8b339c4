"""The blind test from end to end, with as few campaigns as it can have."""

import json
from pathlib import Path

import netCDF4
import pytest

from benchmarks.withheld_effects import check, diagnose_blindly

pytestmark = pytest.mark.slow

COUNTS = {"none": 1, "per-effect": 0, "unmodelled": 0, "pairs": 0, "variants": 0}


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
