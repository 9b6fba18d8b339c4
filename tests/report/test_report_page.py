"""The report of every kind of run: complete, self-contained, honest about what it lacks, true to the tree."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import result_trees
import synthetic_rigs

from mofit.errors import InputError
from mofit.report import DATA_FOLDER, REPORT_FILE, build_report, write_report
from mofit.results import write_result

ALWAYS = {"summary", "parameters", "errors", "signals", "posterior", "convergence", "provenance", "method"}


@pytest.fixture(scope="module")
def tyre(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tyre")
    tree = result_trees.make_result(synthetic_rigs.tyre(), steps=40)
    write_result(tree, folder)
    return tree, folder, build_report(folder).read_text(encoding="utf-8")


def report(tmp_path, tree) -> str:
    return write_report(tree, tmp_path).read_text(encoding="utf-8")


def section_ids(page: str) -> set[str]:
    return set(re.findall(r'<section id="(\w+)"', page))


def data(folder, name: str) -> dict:
    return json.loads((folder / DATA_FOLDER / f"{name}.json").read_text(encoding="utf-8"))


def test_a_full_run_has_every_section(tyre) -> None:
    _, folder, page = tyre
    assert section_ids(page) == ALWAYS | {"search", "per_test", "calibration"}
    assert sorted(p.name for p in folder.iterdir()) == [REPORT_FILE, DATA_FOLDER, "result.nc"]
    assert {p.stem for p in (folder / DATA_FOLDER).iterdir()} == section_ids(page) - {"method"}


def test_the_page_is_self_contained_and_small(tyre) -> None:
    page = tyre[2]
    assert len(page.encode()) < 6e6
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(addresses) > 10
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert "url(" not in page
    assert "@import" not in page


def test_every_figure_has_words_for_it(tyre) -> None:
    page = tyre[2]
    figures = re.findall(r"<figure\b.*?</figure>", page, flags=re.S)
    assert len(figures) >= 8
    for figure in figures:
        assert re.search(r'alt="[^"]{10,}"', figure)
        assert "<b>Good:</b>" in figure
        assert "<b>Bad:</b>" in figure
        assert re.search(r'class="finding">\S', figure)


def test_numbers_behind_the_page_are_those_of_the_tree(tyre) -> None:
    tree, folder, _ = tyre
    errors = data(folder, "errors")["errors"]
    np.testing.assert_array_equal(errors["models"]["m2"], tree["modes/m2/nrmsd"].values)
    np.testing.assert_array_equal(errors["baseline"], tree["baseline/nrmsd"].values)
    assert errors["frequency"][:3] == [None, None, None]
    rows = data(folder, "parameters")["modes"]["m1"]
    assert [row["parameter"] for row in rows] == ["d_y", "c_M", "d_M"]
    for name in ("value", "sd", "q05", "q95"):
        np.testing.assert_array_equal([row[name] for row in rows], tree[f"modes/m1/{name}"].values)
    stages = data(folder, "calibration")["stages"]
    assert [stage["name"] for stage in stages] == ["steady state", "spring"]
    np.testing.assert_array_equal(stages[1]["measured"], tree["calibration/spring/measured"].values)


def test_traces_are_the_last_periods_of_what_counted(tyre) -> None:
    tree, folder, _ = tyre
    trace = next(t for t in data(folder, "signals")["traces"] if t["test"] == "sine_2Hz")
    measured = tree["observed_data/sine_2Hz"].values
    np.testing.assert_array_equal(trace["measured"], measured[-101:])
    loop = next(t for t in data(folder, "signals")["loops"]["m2"] if t["test"] == "sine_2Hz")
    np.testing.assert_array_equal(loop["simulated"], tree["modes/m2/prediction/sine_2Hz"].values[-51:])


def test_headline_of_a_good_run(tyre) -> None:
    tree, folder, page = tyre
    assert 'class="banner good"' in page
    assert 'class="banner bad"' not in page
    headline = data(folder, "summary")["headline"]
    assert headline["plausible"] == 2
    assert headline["nrmsd"] == pytest.approx(float(tree["modes/m1/nrmsd"].mean()))
    assert headline["not_identified"] == []


def test_a_run_that_did_not_converge_says_so_first(tmp_path) -> None:
    page = report(tmp_path, result_trees.make_result(synthetic_rigs.damper(), converged=False, steps=40))
    assert page.index("The sampling did not converge") < page.index('<div class="cards">')
    assert "not converged</span>" in page
    assert "&lt;beware&gt;" in page
    assert "<beware>" not in page


def test_a_parameter_that_the_data_leave_open_is_named(tmp_path) -> None:
    report(tmp_path, result_trees.make_result(synthetic_rigs.crowded(6), steps=40))
    assert data(tmp_path, "summary")["headline"]["not_identified"] == ["extra_1"]
    directions = data(tmp_path, "posterior")["modes"]["m1"]["directions"]
    wide = [direction for direction in directions if direction["width"] > 0.5]
    assert [[change["parameter"] for change in direction["changes"]] for direction in wide] == [["extra_1"]]
    assert "<b>Not identifiable:</b> <span>extra_1</span>" in (tmp_path / REPORT_FILE).read_text(encoding="utf-8")


def test_a_value_outside_of_its_interval_is_not_given_with_a_standard_deviation(tmp_path) -> None:
    """As at the end of a range, where the posterior is wide and lies beside its maximum."""
    tree = result_trees.make_result(synthetic_rigs.tyre(), clusters=1, steps=40)
    mode = tree["modes/m1"]
    place = [str(name) for name in mode["parameter"].values].index("d_M")
    for name, value in (("value", 10_000.0), ("sd", 2_200.0), ("q05", 390.0), ("q95", 7_500.0)):
        changed = mode[name].copy(deep=True)
        changed[place] = value
        mode[name] = changed
    page = report(tmp_path, tree)
    headline = page[page.index("<b>Best mode m1</b>") :].partition("</p>")[0]
    assert "390 … 7\u202f500 (90\u00a0%) N s/m" in headline
    assert "10\u202f000" not in headline
    assert headline.count("±") == 2


@pytest.mark.parametrize("rig", [synthetic_rigs.tyre, synthetic_rigs.damper, synthetic_rigs.oscillator])
def test_missing_groups_leave_their_sections_out(tmp_path, rig) -> None:
    page = report(tmp_path, result_trees.make_result(rig(), optional=False, clusters=1, steps=20))
    assert section_ids(page) == ALWAYS


def test_a_run_without_samples_still_has_a_report(tmp_path) -> None:
    tree = result_trees.make_result(synthetic_rigs.damper(), clusters=1, optional=False, converged=False, steps=20)
    cluster = tree["modes/m1"]
    for name in ("posterior", "sample_stats", "log_likelihood", "posterior_predictive"):
        del cluster[name]
    for name in ("mean", "sd", "q05", "q50", "q95", "ess", "r_hat", "tau", "contraction", "verdict"):
        del cluster[name]
    assert section_ids(report(tmp_path, tree)) == ALWAYS - {"posterior", "convergence"}


@pytest.mark.slow
@pytest.mark.parametrize(("parameters", "clusters"), [(1, 1), (2, 1), (10, 5)])
def test_few_and_many(tmp_path, parameters, clusters) -> None:
    tree = result_trees.make_result(synthetic_rigs.crowded(parameters), clusters=clusters, steps=20)
    page = report(tmp_path, tree)
    assert len(page.encode()) < 10e6
    assert len(data(tmp_path, "parameters")["modes"]) == clusters
    assert ("The figures show the 4 best modes" in page) == (clusters > 4)


def test_broadband_tests_get_spectra_instead_of_loops(tmp_path) -> None:
    page = report(tmp_path, result_trees.make_result(synthetic_rigs.oscillator(), clusters=1, steps=20))
    overlay = data(tmp_path, "signals")
    assert overlay["loops"]["m1"] == []
    assert [s["test"] for s in overlay["spectra"]] == ["multisine_1", "multisine_2"]
    assert len(overlay["traces"][0]["time"]) == 400
    assert "Amplitude spectrum" in page


def test_the_same_tree_gives_the_same_page(tmp_path) -> None:
    tree = result_trees.make_result(synthetic_rigs.crowded(2), clusters=1, steps=20)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    assert report(tmp_path / "a", tree) == report(tmp_path / "b", tree)


def test_numbers_of_an_earlier_report_do_not_linger(tmp_path) -> None:
    (tmp_path / DATA_FOLDER).mkdir()
    (tmp_path / DATA_FOLDER / "old.json").write_text("{}")
    report(tmp_path, result_trees.make_result(synthetic_rigs.crowded(1), clusters=1, optional=False, steps=20))
    assert not (tmp_path / DATA_FOLDER / "old.json").exists()


def test_without_a_result_nothing_is_written(tmp_path) -> None:
    with pytest.raises(InputError, match="there is no file"):
        build_report(tmp_path)
    assert list(tmp_path.iterdir()) == []
