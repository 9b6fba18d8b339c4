"""Comparing experiments: known answers of a damper with a Maxwell branch, files and options, the command."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from published_schemas import violations

from mofit.cli import main
from mofit.cli.app import tests_by_name as parse_groups
from mofit.cli.output import show_comparison
from mofit.data import Campaign, Experiment, Measurement, write_campaign
from mofit.errors import InputError
from mofit.experimental_design.augmentation import Augmentation
from mofit.experimental_design.comparison import compare, compare_files, experiments_of
from mofit.experimental_design.design_job import DesignJob, design_file
from mofit.experimental_design.identifiability import COMBINATION, IDENTIFIABLE, VERDICTS
from mofit.experimental_design.pages.comparison import profile_section
from mofit.experimental_design.pages.frequency import information_over_frequency, loss_peak
from mofit.experimental_design.parameter_samples import box_samples, posterior_samples, reference_values
from mofit.experimental_design.prepare import Inputs, prepare
from mofit.experimental_design.summary import comparison_summary
from mofit.experimental_design.text import augmentation_sentences
from mofit.simulation.virtual_rig.rig import simulate

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
sample_rate = "100 Hz"
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
frequency = "6 Hz"
"""

LINEAR = ("c", "d", "c_M", "d_M")


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("compare") / "damper.toml"
    path.write_text(PLAN, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def known(plan):
    (prepared,) = prepare(Inputs((plan,), samples=8))
    return prepared.information()


@pytest.fixture(scope="module")
def comparison(known):
    return compare([known], experiments_of([known.source], {}))


def test_one_file_gives_every_test_and_all(comparison) -> None:
    assert [row.experiment.name for row in comparison.experiments] == ["low", "middle", "high", "all"]
    assert comparison.experiments[1].seconds == pytest.approx(5.0)
    assert all(set(row.parameters) == set(comparison.parameters) for row in comparison.experiments)
    assert all(entry.verdict in VERDICTS for row in comparison.experiments for entry in row.parameters.values())


def test_more_tests_never_know_less(comparison) -> None:
    *alone, every = comparison.experiments
    for name in comparison.parameters:
        best = min(row.parameters[name].sd_at_values for row in alone)
        assert every.parameters[name].sd_at_values <= best * 1.05
        assert every.parameters[name].bound_sd <= every.parameters[name].sd_at_values * 1.05


def test_one_sine_does_not_know_more_parameters_than_it_has_numbers(comparison) -> None:
    """A linear model at one frequency: two numbers, amplitude and phase."""
    for row in comparison.experiments[:3]:
        assert sum(row.parameters[name].verdict == IDENTIFIABLE for name in LINEAR) <= 2
    assert all(comparison.experiments[3].parameters[name].verdict == IDENTIFIABLE for name in LINEAR)


def test_shares_are_shares_and_leaving_a_test_out_costs(comparison) -> None:
    (shares,) = comparison.shares
    assert np.all(shares.share >= 0)
    assert np.all(shares.share.sum(axis=0) + shares.calibration <= 1 + 1e-9)
    assert np.all(shares.calibration == 0)  # the damper has no calibration stage
    assert np.all(shares.without > 0.95)
    for k in range(len(comparison.parameters)):
        assert np.max(shares.without[:, k]) > 1.05


def test_information_over_frequency_sums_up_to_the_information(known) -> None:
    name = "d_M"
    place = known.source.space.index(name)
    frequency, alone, _ = information_over_frequency(known, name)
    seconds = {test.name: test.seconds for test in known.source.main}
    total = sum(
        test.fisher[0, place, place] * known.samples[0, place] ** 2 / seconds[test.test] for test in known.tests.main
    )
    assert alone.sum() == pytest.approx(total, rel=1e-9)
    assert frequency.min() >= 0


def test_loss_peaks_where_the_loss_stiffness_is_largest() -> None:
    c, d = 19910.0, 7535.0
    frequency = np.linspace(0.01, 2, 20000)
    wt = 2 * np.pi * frequency * d / c
    assert loss_peak(c, d) == pytest.approx(frequency[np.argmax(wt / (1 + wt**2))], rel=1e-3)


def test_a_profile_confirms_or_limits_what_is_in_doubt(comparison) -> None:
    doubtful = [e for row in comparison.experiments for e in row.parameters.values() if e.verdict != IDENTIFIABLE]
    assert doubtful
    for entry in doubtful:
        assert entry.profile is not None
        if entry.verdict == COMBINATION:
            assert entry.correlated_with
            assert entry.parameter not in entry.correlated_with


def test_a_campaign_and_its_plan_agree(plan, tmp_path) -> None:
    """Noise found in simulated data is that of the plan."""
    campaign = tmp_path / "measured.nc"
    write_campaign(simulate(plan), campaign)
    at = dict(zip(LINEAR, (5e3, 200.0, 2e4, 1e3), strict=True))
    comparison = compare_files(Inputs((plan, campaign), "maxwell_damper", at=at, samples=1))
    planned, measured = comparison.experiments
    assert [row.experiment.name for row in comparison.experiments] == ["damper", "measured"]
    for name in comparison.parameters:
        if planned.parameters[name].verdict == IDENTIFIABLE:
            expected = planned.parameters[name].sd_at_values
            assert measured.parameters[name].sd_at_values == pytest.approx(expected, rel=0.1)


def test_samples_are_the_values_first_and_repeatable(known) -> None:
    space, values = known.source.space, known.source.values
    found = box_samples(space, values, ("d_M",), 5, 3)
    np.testing.assert_array_equal(found[0], values)
    np.testing.assert_array_equal(found, box_samples(space, values, ("d_M",), 5, 3))
    others = [k for k, name in enumerate(space.names) if name != "d_M"]
    np.testing.assert_array_equal(found[:, others], np.repeat(values[None, others], 5, axis=0))
    assert len(np.unique(found[:, space.index("d_M")])) == 5


@pytest.mark.parametrize(("at", "words"), [({"d_m": 1.0}, "Did you mean 'd_M'"), ({"d_M": -1.0}, "outside")])
def test_values_must_exist_and_fit(known, at, words) -> None:
    with pytest.raises(InputError, match=words):
        reference_values(known.source.space, known.source.values, at)


def test_samples_of_a_run_are_its_posterior(known) -> None:
    draws = np.linspace(900.0, 1100.0, 101)[None]
    posterior = xr.Dataset({"d_M": (("chain", "draw"), draws)})
    tree = xr.DataTree.from_dict({"/modes/m1": xr.Dataset(attrs={"probability": 0.1}),
                                  "/modes/m2": xr.Dataset(attrs={"probability": 0.9}),
                                  "/modes/m2/posterior": posterior})  # fmt: skip
    found = posterior_samples(tree, known.source.space, known.source.values, 20, 1)
    place = known.source.space.index("d_M")
    assert found[0, place] == 1000.0
    assert np.all((found[:, place] >= 900) & (found[:, place] <= 1100))
    assert len(np.unique(found[:, place])) > 10
    others = np.delete(found, place, axis=1)
    np.testing.assert_array_equal(others, np.repeat(np.delete(known.source.values, place)[None], 20, axis=0))
    empty = xr.DataTree.from_dict({"/modes/m1": xr.Dataset(attrs={"probability": 1.0})})
    with pytest.raises(InputError, match="no posterior"):
        posterior_samples(empty, known.source.space, known.source.values, 20, 1)


def test_an_effect_of_the_plan_counts_where_the_model_has_it(plan, tmp_path) -> None:
    path = tmp_path / "friction.toml"
    text = plan.read_text(encoding="utf-8").replace(
        "[noise.force]", '[[effects]]\nname = "dry_friction"\nparameters = { F_d = "33 N" }\n[noise.force]'
    )
    path.write_text(text, encoding="utf-8")
    (bare,) = prepare(Inputs((path,), samples=1))
    assert any("dry_friction" in note for note in bare.source.notes)
    (whole,) = prepare(Inputs((path,), effects=("dry_friction",), samples=1))
    assert not any("dry_friction" in note for note in whole.source.notes)
    assert whole.source.values[whole.source.space.index("F_d")] == 33.0


def test_groups_are_parsed_and_checked(known) -> None:
    assert parse_groups("--group", ["slow=low, middle", "fast=high"]) == {"slow": ("low", "middle"), "fast": ("high",)}
    for entry in ("slow", "=low", "slow="):
        with pytest.raises(InputError, match="NAME=TEST"):
            parse_groups("--group", [entry])
    with pytest.raises(InputError, match="used twice"):
        parse_groups("--group", ["a=low", "a=high"])
    with pytest.raises(InputError, match=r"no test 'hig'.*Did you mean 'high'"):
        experiments_of([known.source], {"a": ["hig"]})


def test_the_summary_is_plain_and_complete(comparison) -> None:
    data = json.loads(json.dumps(comparison_summary(comparison), allow_nan=False))
    row = data["experiments"][0]
    assert set(row) >= {"name", "seconds", "parameters"}
    assert all(set(entry) >= {"sd", "relative_sd", "verdict"} for entry in row["parameters"].values())


def test_profiles_are_drawn(comparison) -> None:
    section = profile_section(comparison)
    assert section is not None
    assert section.blocks[0].kind == "figure"


def test_the_command_writes_a_page_and_prints_json(plan, tmp_path, capsys) -> None:
    page = tmp_path / "c.html"
    options = ["--parameter", "d_M", "--samples", "2", "--jobs", "1", "--group", "every=low,middle,high"]
    assert main(["compare", str(plan), *options, "--json", "--out", str(page)]) == 0
    data = json.loads(capsys.readouterr().out)
    assert not violations(data)
    assert next(iter(data)) == "schema"
    assert data["experiments"][0]["parameters"]["d_M"]["verdict"] == IDENTIFIABLE
    text = page.read_text(encoding="utf-8")
    sections = re.findall(r'<section id="(\w+)"', text)
    assert sections[:2] == ["verdicts", "information"]
    assert {"frequency", "branch", "correlation", "method"} <= set(sections)
    assert all(address.startswith(("data:", "#")) for address in re.findall(r'(?:src|href)="([^"]*)"', text))
    assert not re.search(r">nan<|\bnan\b", text)


def test_the_command_exits_with_4_and_proposes_an_augmentation(plan, capsys) -> None:
    options = ["--parameter", "c", "--samples", "1", "--jobs", "1", "--group", "fast=high"]
    assert main(["compare", str(plan), *options, "--json"]) == 4
    data = json.loads(capsys.readouterr().out)
    assert not violations(data)
    assert data["not_identifiable"] == ["c"]
    found = data["augmentations"]["c"]
    assert found["sd"] < data["experiments"][0]["parameters"]["c"]["sd_at_values"]
    assert found["seconds"] == found["repeats"] * 20


def test_sentences_name_the_augmentation_and_the_terminal_shows_them(comparison, capsys) -> None:
    found = Augmentation("sine of 1 Hz, amplitude 0.01 m", 3, 60.0, 50.0)
    sentences = augmentation_sentences(replace(comparison, augmentations={"d_M": found, "c": None}))
    assert sentences == [
        "Cheapest augmentation for d_M: one more test, sine of 1 Hz, amplitude 0.01 m, 20 s, 3 times: ±5 %.",
        "c: no single sine, chirp or step within ten minutes would make it identifiable.",
    ]
    show_comparison(comparison_summary(comparison), sentences)
    shown = capsys.readouterr().out
    assert "Cheapest augmentation for d_M" in shown
    assert all(row.experiment.name in shown for row in comparison.experiments)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--parameter", "d_X"], "no such parameter"),
        (["--group", "a=nothing"], "no test 'nothing'"),
        (["--at", "d_M"], "NAME=NUMBER"),
    ],
)
def test_unusable_options_exit_with_2(plan, capsys, extra, words) -> None:
    assert main(["compare", str(plan), "--samples", "1", *extra]) == 2
    assert words in capsys.readouterr().err


def test_no_file_or_the_same_twice_is_an_error(plan, capsys) -> None:
    assert main(["compare"]) == 2
    assert main(["compare", str(plan), str(plan)]) == 2
    assert "two files have this name" in capsys.readouterr().err


def test_parameters_with_a_value_per_test_count_as_one_value(tmp_path) -> None:
    """And a campaign whose tests nothing drives does not say what to try next."""
    time, tests = np.arange(500) / 200.0, []
    for name, start in (("soft", 0.01), ("hard", 0.02)):
        values = start * np.exp(-1.5 * time) * np.cos(75.0 * time)
        values += 1e-4 * np.random.default_rng(1).standard_normal(len(time))
        tests.append(Measurement(Experiment(name, "free", time, {}), {"displacement": values}, {"displacement": "m"}))
    write_campaign(Campaign("taps", "simulated", {}, tuple(tests)), tmp_path / "taps.nc")
    inputs = Inputs((tmp_path / "taps.nc",), "oscillator", ("start:position",), samples=2)
    found = compare_files(inputs)
    assert any("position_start count as one value for all tests" in note for note in found.notes)
    with pytest.raises(InputError, match="none of its tests has the input"):
        design_file(DesignJob(inputs))
