"""The uncertainty page of every kind of run, its command, and how it opens in a browser."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import result_trees
import synthetic_rigs
import xarray as xr
from published_schemas import violations

from mofit.cli import main
from mofit.report import UNCERTAINTY_FILE, UNCERTAINTY_FOLDER, build_report, build_uncertainty
from mofit.report.uncertainty.table import uncertainty_summary
from mofit.results import write_result

SECTIONS = ["summary", "marginals", "directions", "corner", "loops", "frequency", "homogeneity", "convergence"]
CHROMIUM = next(
    (p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome") if Path(p).exists()), ""
)


def build(folder: Path, tree: xr.DataTree) -> str:
    return build_uncertainty(folder, tree).read_text(encoding="utf-8")


def section_ids(page: str) -> list[str]:
    return re.findall(r'<section id="(\w+)"', page)


def data(folder: Path, name: str) -> dict:
    return json.loads((folder / UNCERTAINTY_FOLDER / f"{name}.json").read_text(encoding="utf-8"))


def run_folder(folder: Path, **settings) -> Path:
    """A small run on disk; its last parameter, extra_0, is left open."""
    tree = result_trees.make_result(synthetic_rigs.crowded(5), clusters=1, optional=False, steps=20, **settings)
    write_result(tree, folder)
    return folder


def test_a_full_run_has_every_section_in_order(tmp_path) -> None:
    tree = result_trees.make_result(synthetic_rigs.tyre(), steps=40)
    write_result(tree, tmp_path)
    page = build_uncertainty(tmp_path).read_text(encoding="utf-8")
    assert section_ids(page) == [*SECTIONS, "method"]
    assert {p.name for p in tmp_path.iterdir()} == {"result.nc", UNCERTAINTY_FILE, UNCERTAINTY_FOLDER}
    assert {p.stem for p in (tmp_path / UNCERTAINTY_FOLDER).iterdir()} == set(SECTIONS) - {"corner"}
    assert len(page.encode()) < 10e6
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(address.startswith(("data:", "#")) for address in addresses)
    lines = data(tmp_path, "summary")["modes"]["m2"]
    for name in ("mean", "sd", "q05", "q95", "contraction"):
        shown = [line["estimate"][name] for line in lines]
        np.testing.assert_array_equal(shown, tree[f"modes/m2/{name}"].values)
    assert page.count("Good:") == page.count("Bad:") >= 6


def test_both_pages_live_in_one_folder(tmp_path) -> None:
    run_folder(tmp_path)
    build_uncertainty(tmp_path)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    build_report(tmp_path / "result.nc")
    assert all(path.read_bytes() == content for path, content in before.items())


@pytest.mark.parametrize(
    ("rig", "missing"),
    [
        (synthetic_rigs.tyre, {"homogeneity"}),
        (synthetic_rigs.oscillator, {"homogeneity"}),
        (lambda: synthetic_rigs.crowded(1), {"homogeneity", "corner"}),
    ],
)
def test_missing_groups_leave_their_sections_out(tmp_path, rig, missing) -> None:
    page = build(tmp_path, result_trees.make_result(rig(), optional=False, clusters=1, steps=20))
    assert section_ids(page) == [s for s in [*SECTIONS, "method"] if s not in missing]


def test_a_run_without_samples_says_so(tmp_path) -> None:
    tree = result_trees.make_result(synthetic_rigs.damper(), clusters=1, optional=False, converged=False, steps=20)
    cluster = tree["modes/m1"]
    for name in ("posterior", "sample_stats", "log_likelihood", "posterior_predictive"):
        del cluster[name]
    for name in ("mean", "sd", "q05", "q50", "q95", "ess", "r_hat", "tau", "contraction", "verdict"):
        del cluster[name]
    page = build(tmp_path, tree)
    assert section_ids(page) == ["summary", "method"]
    assert page.count("not sampled, so its uncertainty is not known") == 4


def test_what_the_data_leave_open_is_said_in_words(tmp_path) -> None:
    page = build(tmp_path, result_trees.make_result(synthetic_rigs.crowded(6), steps=40))
    flat = [d for d in data(tmp_path, "directions")["modes"]["m1"]["directions"] if d["width"] > 0.5]
    assert [[c["parameter"] for c in d["changes"]] for d in flat] == [["extra_1"]]
    assert "<b>Not identifiable:</b> <span>extra_1</span>" in page
    assert "compensate each other" in page


def test_a_run_that_did_not_converge_says_so_first(tmp_path) -> None:
    page = build(tmp_path, result_trees.make_result(synthetic_rigs.damper(), converged=False, steps=20))
    assert page.index("The sampling did not converge") < page.index("<table>")


def test_names_of_parameters_are_text(tmp_path) -> None:
    tree = result_trees.make_result(synthetic_rigs.crowded(2), clusters=1, optional=False, steps=20)
    names = {"F_0": "<b>&"}
    cluster = tree["modes/m1"]
    for node in (tree["parameters"], cluster):
        renamed = [names.get(str(n), str(n)) for n in node.dataset["parameter"].values]
        node.dataset = node.to_dataset().assign_coords(parameter=renamed)
    cluster["posterior"].dataset = cluster["posterior"].to_dataset(inherit=False).rename(names)
    page = build(tmp_path, tree)
    assert "<b>&:" not in page
    assert "&lt;b&gt;&amp;" in page
    assert uncertainty_summary(tree)["modes"][0]["parameters"]["<b>&"]["sentence"].startswith("<b>&: ")


@pytest.mark.parametrize(
    ("title", "expected"),
    [("Tyre (simulated)", "· Tyre (simulated) ·"), ("Tyre", "· Tyre (simulated) ·")],
)
def test_the_subtitle_names_the_source_once(tmp_path, title, expected) -> None:
    tree = result_trees.make_result(synthetic_rigs.crowded(1), clusters=1, optional=False, steps=20)
    tree.attrs["campaign_title"] = title
    page = build(tmp_path, tree)
    assert expected in page
    assert "(simulated) (simulated)" not in page


def test_the_command_prints_the_page_or_the_table(tmp_path, capsys) -> None:
    folder = run_folder(tmp_path)
    assert main(["uncertainty", str(folder), "--parameter", "c"]) == 0
    assert capsys.readouterr().out.strip() == str(folder / UNCERTAINTY_FILE)
    assert main(["uncertainty", str(folder), "--json", "--parameter", "c", "--parameter", "extra_0"]) == 4
    printed = json.loads(capsys.readouterr().out)
    assert Path(printed["uncertainty"]).exists()
    assert not violations(printed)
    assert printed["converged"] is True
    assert printed["not_identifiable"] == ["extra_0"]


def test_the_table_of_all_solutions() -> None:
    tree = result_trees.make_result(synthetic_rigs.crowded(6), steps=20)
    table = uncertainty_summary(tree)
    assert [mode["id"] for mode in table["modes"]] == ["m1", "m2"]
    entry = table["modes"][0]["parameters"]["extra_1"]
    assert entry["verdict"] == "not identifiable"
    assert entry["sentence"].startswith("extra_1: ")
    assert entry["sd"] == float(tree["modes/m1/sd"].sel(parameter="extra_1"))
    assert set(table["homogeneity"]) == set(table["modes"][0]["parameters"])
    assert table["not_identifiable"] == []
    assert uncertainty_summary(tree, ["c", "extra_1", "extra_1"])["not_identifiable"] == ["extra_1"]
    json.dumps(table, allow_nan=False)


def test_a_parameter_that_the_run_does_not_have_is_refused(tmp_path, capsys) -> None:
    folder = run_folder(tmp_path)
    assert main(["uncertainty", str(folder), "--parameter", "extra_1"]) == 2
    assert "Did you mean 'extra_0'?" in capsys.readouterr().err
    assert not (folder / UNCERTAINTY_FILE).exists()


def test_a_run_that_did_not_converge_ends_with_3(tmp_path, capsys) -> None:
    folder = run_folder(tmp_path, converged=False)
    assert main(["uncertainty", str(folder), "--parameter", "extra_0", "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["converged"] is False


def test_without_a_run_nothing_is_written(tmp_path, capsys) -> None:
    assert main(["uncertainty", str(tmp_path)]) == 2
    assert "there is no file" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_command_explains_itself_with_an_example(capsys) -> None:
    assert main(["uncertainty", "--help"]) == 0
    assert "Example: mofit uncertainty" in " ".join(capsys.readouterr().out.split())


@pytest.mark.browser
@pytest.mark.skipif(not CHROMIUM, reason="no Chromium on this machine")
@pytest.mark.parametrize("rig", [synthetic_rigs.tyre, synthetic_rigs.oscillator])
def test_the_page_opens_clean(tmp_path, rig) -> None:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    report = build_uncertainty(tmp_path, result_trees.make_result(rig(), steps=20))
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--headless", "--no-sandbox", "--disable-gpu"]
        )
        for width in (1240, 390):
            page = browser.new_page(viewport={"width": width, "height": 900})
            messages, requests = [], []
            page.on("console", lambda message, to=messages: to.append(message.text))
            page.on("pageerror", lambda error, to=messages: to.append(str(error)))
            page.on("request", lambda request, to=requests: to.append(request.url))
            page.goto(report.as_uri(), wait_until="networkidle")
            assert messages == []
            assert [url for url in requests if not url.startswith("data:")] == [report.as_uri()]
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            page.wait_for_function("[...document.images].every(image => image.complete)")
            assert page.evaluate("[...document.images].every(image => image.naturalWidth > 100)")
        browser.close()
