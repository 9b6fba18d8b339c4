"""The start page of a folder of runs: all runs are there, the damaged one with its reason; the page opens."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
import result_trees
import synthetic_rigs
from browser import chromium, opened
from published_schemas import violations

from mofit.cli import main
from mofit.errors import InputError
from mofit.report import write_report
from mofit.results import write_result
from mofit.workflows.runs import find_runs, mean, page_of
from mofit.workflows.runs_page import write_runs

DIAGNOSIS = {
    "verdict": "effect", "sentence": "Friction causes the gap.", "campaign": "Rig", "model_title": "Damper",
    "model_parameters": {"c": {"unit": "N/m", "before": 900.0, "after": 1000.0, "sd": 10.0, "at_bound": True}},
    "nrmsd_after": {"a": 0.02, "b": 0.04}, "noise_floor": {"a": 0.01, "b": 0.01},
    "where": {"gap": 1.5, "unit": "N"}, "shrinkage": {"kinds": [{"share": 0.5}, {"share": 0.9}]}, "warnings": [],
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two identifications of one rig, a diagnosis, and a damaged result."""
    place = tmp_path_factory.mktemp("runs")
    for name, seed in (("first", 0), ("batch/second", 1)):
        (place / name).mkdir(parents=True)
        write_result(result_trees.make_result(synthetic_rigs.damper(), seed=seed, steps=20), place / name)
    write_report(result_trees.make_result(synthetic_rigs.damper(), steps=20), place / "first")
    for name in ("diagnosis", "damaged"):
        (place / name).mkdir()
    (place / "diagnosis" / "diagnosis.json").write_text(json.dumps(DIAGNOSIS))
    (place / "damaged" / "result.nc").write_bytes(b"nothing")
    return place


def test_all_runs_are_found(folder):
    entries = {entry.name: entry for entry in find_runs(folder)}
    assert list(entries) == ["batch/second", "damaged", "diagnosis", "first"]
    assert [entry.what for entry in entries.values()] == ["identify", "unreadable", "diagnose", "identify"]
    found = entries["diagnosis"]
    assert (found.grade, found.verdict, found.gap, found.removed) == ("good", "Friction causes the gap.", 1.5, 0.9)
    assert mean(found.nrmsd) == pytest.approx(0.03)
    assert (found.parameters["c"].value, found.parameters["c"].verdict) == (1000.0, "at a bound")
    assert "result.nc" in entries["damaged"].verdict
    assert (entries["first"].page, entries["batch/second"].page) == ("first/report.html", "")


def test_the_page_puts_two_runs_side_by_side(folder):
    page_file = write_runs(find_runs(folder), folder)
    assert page_file == folder / "runs.html"
    values = {entry.name: entry.parameters["c"] for entry in find_runs(folder) if "c" in entry.parameters}
    with chromium() as browser, opened(browser, page_file) as page:
        assert page.locator("#runs tbody tr").count() == 4
        assert page.locator('#runs a[href="first/report.html"]').count() == 1
        first, second = (page.locator(".abreast select").nth(k) for k in (0, 1))
        first.select_option("diagnosis")
        second.select_option("first")
        heads = page.locator("#beside thead th:visible")
        assert sorted(heads.all_inner_texts()) == sorted(["Quantity", "Unit", "diagnosis", "first", "Apart"])
        row = page.locator("#beside tbody tr").filter(has=page.locator("th", has_text=re.compile("^c$"))).first
        a, b = values["diagnosis"], values["first"]
        apart = (b.value - a.value) / (a.sd**2 + b.sd**2) ** 0.5
        assert float(row.locator("td").last.inner_text().split()[0].replace("−", "-")) == pytest.approx(apart, abs=0.06)


def test_the_command_prints_all_and_writes_the_page(folder, capsys):
    assert main(["runs", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert not violations(found)
    assert [run["name"] for run in found["runs"]] == ["batch/second", "damaged", "diagnosis", "first"]
    assert main(["runs", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert "Friction causes the gap." in shown
    assert str(folder / "runs.html") in "".join(shown.split("\n"))


def test_a_folder_without_runs_is_refused_and_nothing_written(tmp_path, capsys):
    assert main(["runs", str(tmp_path)]) == 2
    assert "there is no run in it" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="no such folder"):
        find_runs(tmp_path / "none")


def test_open_hands_the_page_to_the_browser_or_says_where_it_is(folder, tmp_path):
    command = [sys.executable, "-m", "mofit", "open", str(folder / "first")]
    note = tmp_path / "opened"
    (tmp_path / "browser").write_text(f'#!/bin/sh\necho "$1" > {note}\n')
    (tmp_path / "browser").chmod(0o755)
    environment = {**os.environ, "BROWSER": str(tmp_path / "browser")}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert note.read_text().strip() == (folder / "first" / "report.html").resolve().as_uri()
    assert done.stdout.strip() == str(folder / "first" / "report.html")
    assert done.stderr == ""
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True, env=environment)
    found = json.loads(done.stdout)
    assert not violations(found)
    assert found["opened"] is True
    copy = tmp_path / "without_page"
    shutil.copytree(folder / "batch" / "second", copy)
    with pytest.raises(InputError, match="there is no page in it"):
        page_of(copy)
