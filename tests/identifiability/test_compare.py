"""Comparing procedures: known answers of a damper with a Maxwell branch, files and options, the command."""

import json
import re

import numpy as np
import pytest
import xarray as xr

from mofit.campaign_file import write_campaign
from mofit.cli import main
from mofit.errors import InputError
from mofit.identifiability.compare import compare, procedures_of
from mofit.identifiability.compare_files import CompareJob, compare_files, mend_sentence, parse_groups, summary
from mofit.identifiability.compare_page import write_comparison
from mofit.identifiability.compare_page.branch import loss_peak
from mofit.identifiability.compare_page.frequency import information_over_frequency
from mofit.identifiability.mend import cheapest_mend
from mofit.identifiability.points import around, at_values, of_run
from mofit.identifiability.sources import read_source
from mofit.identifiability.telling import tell
from mofit.identifiability.verdicts import COMBINATION, IDENTIFIABLE, VERDICTS
from mofit.library import find_effect, find_model
from mofit.model import with_effects
from mofit.simulate import simulate

PLAN = """
title = "damper"
model = "maxwell_damper"
seed = 1
[parameters]
c = "5 kN/m"
d = "200 N s/m"
c_M = "20 kN/m"
d_M = "1000 N s/m"
[noise.force]
sd = "5 N"
[defaults]
sample_rate = "200 Hz"
amplitude = "10 mm"
periods = 10
[[tests]]
name = "low"
kind = "sine"
frequency = "0.3 Hz"
[[tests]]
name = "middle"
kind = "sine"
frequency = "2 Hz"
[[tests]]
name = "high"
kind = "sine"
frequency = "12 Hz"
"""

LINEAR = ("c", "d", "c_M", "d_M")


@pytest.fixture(scope="module")
def damper():
    return find_model("maxwell_damper")


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("compare") / "damper.toml"
    path.write_text(PLAN, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def told(plan, damper):
    source = read_source(plan, lambda _: damper)
    return tell(source, around(source.space, source.values, source.space.names, 8, 0))


@pytest.fixture(scope="module")
def comparison(told):
    return compare([told], procedures_of([told.source], {}))


def test_one_file_gives_every_test_and_all(comparison) -> None:
    assert [row.procedure.name for row in comparison.judged] == ["low", "middle", "high", "all"]
    assert comparison.judged[1].seconds == pytest.approx(5.0)
    assert all(set(row.entries) == set(comparison.parameters) for row in comparison.judged)
    assert all(entry.verdict in VERDICTS for row in comparison.judged for entry in row.entries.values())


def test_more_tests_never_know_less(comparison) -> None:
    *alone, every = comparison.judged
    for name in comparison.parameters:
        best = min(row.entries[name].sd_here for row in alone)
        assert every.entries[name].sd_here <= best * 1.05
        assert every.entries[name].bound_sd <= every.entries[name].sd_here * 1.05


def test_one_sine_does_not_know_more_parameters_than_it_has_numbers(comparison) -> None:
    """A linear model at one frequency: two numbers, amplitude and phase."""
    for row in comparison.judged[:3]:
        assert sum(row.entries[name].verdict == IDENTIFIABLE for name in LINEAR) <= 2
    assert all(comparison.judged[3].entries[name].verdict == IDENTIFIABLE for name in LINEAR)


def test_shares_are_shares_and_leaving_a_test_out_costs(comparison) -> None:
    (carried,) = comparison.carried
    assert np.all(carried.share >= 0)
    assert np.all(carried.share.sum(axis=0) + carried.calibration <= 1 + 1e-9)
    assert np.all(carried.calibration == 0)  # the damper has no calibration stage
    assert np.all(carried.without > 0.95)
    for k in range(len(comparison.parameters)):
        assert np.max(carried.without[:, k]) > 1.05


def test_information_over_frequency_sums_up_to_the_information(told) -> None:
    name = "d_M"
    place = told.source.space.index(name)
    frequency, alone, _ = information_over_frequency(told, name)
    seconds = {test.name: test.seconds for test in told.source.main}
    total = sum(
        test.information[0, place, place] * told.values[0, place] ** 2 / seconds[test.test] for test in told.shown
    )
    assert alone.sum() == pytest.approx(total, rel=1e-9)
    assert frequency.min() >= 0


def test_loss_peaks_where_the_loss_stiffness_is_largest() -> None:
    c, d = 19910.0, 7535.0
    frequency = np.linspace(0.01, 2, 20000)
    wt = 2 * np.pi * frequency * d / c
    assert loss_peak(c, d) == pytest.approx(frequency[np.argmax(wt / (1 + wt**2))], rel=1e-3)


def test_a_profile_confirms_or_limits_what_is_in_doubt(comparison) -> None:
    doubtful = [e for row in comparison.judged for e in row.entries.values() if e.verdict != IDENTIFIABLE]
    assert doubtful
    for entry in doubtful:
        assert entry.limits is not None
        if entry.verdict == COMBINATION:
            assert entry.partners
            assert entry.parameter not in entry.partners


def test_a_mend_mends(told) -> None:
    comparison = compare([told], procedures_of([told.source], {"low": ["low"]}))
    row = comparison.judged[0]
    name = next(name for name, entry in row.entries.items() if entry.verdict != IDENTIFIABLE)
    mend = cheapest_mend(told, row.procedure, name)
    assert mend is not None
    assert mend.sd < row.entries[name].sd_here
    assert mend.seconds == mend.repeats * 20
    assert name in mend_sentence(name, mend, comparison)
    assert "no single" in mend_sentence(name, None, comparison)


def test_a_campaign_and_its_plan_agree(plan, damper, tmp_path) -> None:
    """Noise found in simulated data is that of the plan."""
    campaign = tmp_path / "damper.nc"
    write_campaign(simulate(plan), campaign)
    job = CompareJob(files=(plan, campaign.rename(tmp_path / "measured.nc")), points=1)
    at = dict(zip(LINEAR, (5e3, 200.0, 2e4, 1e3), strict=True))
    comparison, _ = compare_files(CompareJob(job.files, points=1, at=at), lambda _: damper)
    planned, measured = comparison.judged
    assert [row.procedure.name for row in comparison.judged] == ["damper", "measured"]
    for name in comparison.parameters:
        if planned.entries[name].verdict == IDENTIFIABLE:
            assert measured.entries[name].sd_here == pytest.approx(planned.entries[name].sd_here, rel=0.1)


def test_points_are_the_values_first_and_repeatable(told) -> None:
    space, values = told.source.space, told.source.values
    found = around(space, values, ("d_M",), 5, 3)
    np.testing.assert_array_equal(found[0], values)
    np.testing.assert_array_equal(found, around(space, values, ("d_M",), 5, 3))
    others = [k for k, name in enumerate(space.names) if name != "d_M"]
    np.testing.assert_array_equal(found[:, others], np.repeat(values[None, others], 5, axis=0))
    assert len(np.unique(found[:, space.index("d_M")])) == 5


@pytest.mark.parametrize(("at", "words"), [({"d_m": 1.0}, "Did you mean 'd_M'"), ({"d_M": -1.0}, "outside")])
def test_values_must_exist_and_fit(told, at, words) -> None:
    with pytest.raises(InputError, match=words):
        at_values(told.source.space, told.source.values, at)


def test_points_of_a_run_are_its_posterior(told) -> None:
    draws = np.linspace(900.0, 1100.0, 101)[None]
    posterior = xr.Dataset({"d_M": (("chain", "draw"), draws)})
    tree = xr.DataTree.from_dict({"/clusters/c1": xr.Dataset(attrs={"weight": 0.1}),
                                  "/clusters/c2": xr.Dataset(attrs={"weight": 0.9}),
                                  "/clusters/c2/posterior": posterior})  # fmt: skip
    found = of_run(tree, told.source.space, told.source.values, 20, 1)
    place = told.source.space.index("d_M")
    assert found[0, place] == 1000.0
    assert np.all((found[:, place] >= 900) & (found[:, place] <= 1100))
    assert len(np.unique(found[:, place])) > 10
    others = np.delete(found, place, axis=1)
    np.testing.assert_array_equal(others, np.repeat(np.delete(told.source.values, place)[None], 20, axis=0))
    empty = xr.DataTree.from_dict({"/clusters/c1": xr.Dataset(attrs={"weight": 1.0})})
    with pytest.raises(InputError, match="no posterior"):
        of_run(empty, told.source.space, told.source.values, 20, 1)


def test_an_effect_of_the_plan_counts_where_the_model_has_it(plan, tmp_path) -> None:
    path = tmp_path / "friction.toml"
    text = plan.read_text(encoding="utf-8").replace(
        "[noise.force]", '[[effects]]\nname = "dry_friction"\nparameters = { F_d = "33 N" }\n[noise.force]'
    )
    path.write_text(text, encoding="utf-8")
    base = find_model("maxwell_damper")
    bare = read_source(path, lambda _: base)
    assert any("dry_friction" in note for note in bare.notes)
    whole = read_source(path, lambda _: with_effects(base, find_effect("dry_friction")))
    assert not any("dry_friction" in note for note in whole.notes)
    assert whole.values[whole.space.index("F_d")] == 33.0


def test_groups_are_parsed_and_checked(told) -> None:
    assert parse_groups(["slow=low, middle", "fast=high"]) == {"slow": ("low", "middle"), "fast": ("high",)}
    for entry in ("slow", "=low", "slow="):
        with pytest.raises(InputError, match="NAME=TEST"):
            parse_groups([entry])
    with pytest.raises(InputError, match="used twice"):
        parse_groups(["a=low", "a=high"])
    with pytest.raises(InputError, match=r"no test 'hig'.*Did you mean 'high'"):
        procedures_of([told.source], {"a": ["hig"]})


def test_the_summary_is_plain_and_complete(comparison) -> None:
    data = json.loads(json.dumps(summary(comparison, {}), allow_nan=False))
    row = data["procedures"][0]
    assert set(row) >= {"name", "seconds", "parameters"}
    assert all(set(entry) >= {"sd", "relative_sd", "verdict"} for entry in row["parameters"].values())


def test_the_page_is_self_contained(comparison, tmp_path) -> None:
    page = write_comparison(comparison, ["mend it"], tmp_path / "page.html").read_text(encoding="utf-8")
    sections = re.findall(r'<section id="(\w+)"', page)
    assert sections[:2] == ["verdicts", "carried"]
    assert {"frequency", "branch", "together", "profiles", "method"} <= set(sections)
    assert all(address.startswith(("data:", "#")) for address in re.findall(r'(?:src|href)="([^"]*)"', page))
    assert "mend it" in page
    assert not re.search(r">nan<|\bnan\b", page)


def test_the_command_exits_with_4_and_says_why(plan, tmp_path, capsys) -> None:
    name = "d_M"
    wanted = ["compare", str(plan), "--parameter", name, "--points", "4", "--jobs", "1"]
    assert main([*wanted, "--json", "--group", "every=low,middle,high", "--out", str(tmp_path / "c.html")]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["procedures"][0]["parameters"][name]["verdict"] == IDENTIFIABLE
    assert (tmp_path / "c.html").exists()
    code = main([*wanted, "--group", "fast=high"])
    shown = capsys.readouterr().out
    assert code == 4
    assert "Cheapest mend for d_M" in shown
    assert "fast" in shown


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--parameter", "d_X"], "no such parameter"),
        (["--group", "a=nothing"], "no test 'nothing'"),
        (["--at", "d_M"], "NAME=NUMBER"),
    ],
)
def test_unusable_options_exit_with_2(plan, capsys, extra, words) -> None:
    assert main(["compare", str(plan), "--points", "1", *extra]) == 2
    assert words in capsys.readouterr().err


def test_no_file_or_the_same_twice_is_refused(plan, capsys) -> None:
    assert main(["compare"]) == 2
    assert main(["compare", str(plan), str(plan)]) == 2
    assert "two files have this name" in capsys.readouterr().err
