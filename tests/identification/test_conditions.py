"""Dampers under loads and temperatures, whose parameters follow known laws."""

import json
from dataclasses import replace

import numpy as np
import pytest
from xarray import DataTree

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, joined, read_campaign, write_campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.prediction import predict
from mofit.results import open_result, summary

LOADS, TEMPERATURES, NOISE = (2e3, 3e3, 4e3), (280.0, 320.0), 2.0


def stiffness(load: float, temperature: float) -> float:
    return 2e4 * (1 + 0.3 * (load - 3e3) / 1e3) * (1 - 0.05 * (temperature - 300) / 20)


def damping(load: float) -> float:
    return 500 * (1 + 0.2 * (load - 3e3) / 1e3)


def damper(load: float, temperature: float, seed: int) -> Campaign:
    rng, measurements = np.random.default_rng(seed), []
    for frequency in (0.5, 2.0):
        time = np.arange(0, 4 / frequency, 1 / (50 * frequency))
        omega = 2 * np.pi * frequency
        x, v = 0.01 * np.sin(omega * time), 0.01 * omega * np.cos(omega * time)
        force = stiffness(load, temperature) * x + damping(load) * v + 5 + NOISE * rng.normal(size=len(time))
        experiment = Experiment(
            f"{frequency:g}Hz", "sine", time, {"displacement": x}, frequency=frequency, amplitude=0.01
        )
        measurements.append(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
    conditions = {"vertical_force": load, "temperature": temperature}
    return Campaign("damper", "simulated", conditions, tuple(measurements))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("dampers"), []
    for load in LOADS:
        for temperature in TEMPERATURES:
            found.append(folder / f"F{load:g}_T{temperature:g}.nc")
            write_campaign(damper(load, temperature, len(found)), found[-1])
    return found


@pytest.fixture(scope="module")
def run(files, tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "laws"
    held_out = "vertical_force=3000,temperature=320"
    given = [*map(str, files), "--model", "kelvin_voigt_damper", "--fix", "p=0", "--over", "vertical_force,temperature"]
    code = main(["identify", *given, "--hold-out", held_out, "--no-sample", "--jobs", "1", "--out", str(out)])
    assert code == 3  # not sampled
    return out


@pytest.fixture(scope="module")
def tree(run) -> DataTree:
    return open_result(run)


def test_the_laws_that_made_the_data_are_found(tree):
    laws = tree["laws"].to_dataset(inherit=False)
    assert dict(zip(laws["law"].values, laws["form"].values, strict=True)) == {
        "c over vertical_force": "linear",
        "c over temperature": "linear",
        "d over vertical_force": "linear",
        "d over temperature": "constant",
        "F_0 over vertical_force": "constant",
        "F_0 over temperature": "constant",
    }
    mode = tree["modes/m1"].dataset
    truth = {"c": 2e4, "d": 500.0, "F_0": 5.0, "c_vertical_force": 0.3, "c_temperature": -0.05, "d_vertical_force": 0.2}
    values = mode["value"].sel(parameter=list(truth)).values
    z = (values - list(truth.values())) / mode["laplace_sd"].sel(parameter=list(truth)).values
    assert np.abs(z).max() < 4
    assert values == pytest.approx(list(truth.values()), rel=0.02)


def test_a_condition_left_out_is_predicted_inside_its_band(tree):
    held_out = tree["held_out"].to_dataset(inherit=False)
    left = held_out.sel(record=held_out["role"].values == "held out")
    assert list(left["record"].values) == ["F3000_T320 0.5Hz", "F3000_T320 2Hz"]
    assert np.all((left["coverage"].values > 0.8) & (left["coverage"].values < 0.98))


def test_a_condition_that_no_file_has_is_predicted(run):
    between = predict(run, damper(3.5e3, 310.0, 99))
    clean = stiffness(3.5e3, 310) * 0.01 * np.sin(np.pi * np.arange(0, 8, 0.04))
    clean += damping(3.5e3) * 0.01 * np.pi * np.cos(np.pi * np.arange(0, 8, 0.04)) + 5
    assert between["tests/0.5Hz"].dataset["median"].values == pytest.approx(clean, abs=0.5)


def test_the_curves_hold_the_truth(tree):
    curve = tree["laws/curves/c/vertical_force"].to_dataset(inherit=False)
    truth = [stiffness(load, 300.0) for load in curve["at"].values]
    assert curve["median"].values == pytest.approx(truth, rel=0.01)
    assert curve["at"].attrs["units"] == "N"
    assert np.all(curve["low"].values < curve["high"].values)


def test_the_map_over_two_conditions_holds_the_truth(tree):
    own = tree["laws/maps/c"].to_dataset(inherit=False)
    truth = [[stiffness(load, temperature) for load in own["x"].values] for temperature in own["y"].values]
    assert own["median"].values == pytest.approx(np.array(truth), rel=0.01)
    assert "d" not in tree["laws/maps"].children


def test_one_fit_is_narrower_than_those_of_the_combinations(tree):
    cells = tree["laws/cells"].to_dataset(inherit=False)
    alone = cells["sd"].sel(parameter="c").values
    joint = (cells["law_high"] - cells["law_low"]).sel(parameter="c").values / 3.29
    assert joint.mean() < 0.85 * alone.mean()


def test_the_report_shows_the_laws(run):
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "Parameters over conditions" in page
    assert "The 9 estimates to spare scatter about them" in page


def test_laws_are_printed_as_json(tree, run):
    found = json.loads(json.dumps(summary(tree, run)))["laws"]
    assert found["conditions"] == ["vertical_force", "temperature"]
    assert len(found["combinations"]) == 5
    assert found["freedom"] == 15 - 6


@pytest.mark.slow
def test_what_follows_no_law_has_a_value_per_load(files, tmp_path):
    whole = joined([read_campaign(file) for file in files[::2]], [file.stem for file in files[::2]])
    settings = Settings(
        fixed={"p": 0.0}, over=("vertical_force",), laws={"c": "free", "d": "linear", "F_0": "constant"},
        sample=False, jobs=1,
    )  # fmt: skip
    _, tree = identify(whole, "kelvin_voigt_damper", settings, out=tmp_path / "run")
    own = tree["modes/m1/scoped"].to_dataset(inherit=False).sel(parameter_scoped="c")
    assert list(own["label"].values[::2]) == [f"vertical_force = {load:g}" for load in LOADS]
    assert own["value"].values[::2] == pytest.approx([stiffness(load, 280.0) for load in LOADS], rel=0.01)
    assert own["value"].values[1::2] == pytest.approx(own["value"].values[::2])
    assert list(tree["modes/m1"].dataset["parameter"].values) == ["d", "F_0", "d_vertical_force"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--over", "temperature"], "280 in all tests"),
        (["--over", "vertical_force,vertical_force"], "twice"),
        (["--over", "vertical_force", "--law", "c=cubic"], "unknown law"),
        (["--over", "vertical_force", "--law", "e=linear"], "no free parameter 'e'"),
        (["--over", "vertical_force", "--law", "c=quadratic"], "needs 3 values"),
        (["--over", "vertical_force", "--law", "c@temperature=linear"], "no condition of --over"),
        (["--over", "vertical_force", "--law", "others=shared"], "every parameter is shared"),
        (["--over", "vertical_force", "--law", "c=shared,linear"], "leaves nothing to choose"),
        (["--law", "c=linear"], "without --over"),
        (["--hold-out", "vertical_force=9"], "no test has these conditions"),
    ],
)
def test_what_cannot_be_used_is_refused(files, options, message, tmp_path, capsys):
    given = [str(files[0]), str(files[2]), "--model", "kelvin_voigt_damper", "--fix", "p=0", *options]
    assert main(["identify", *given, "--out", str(tmp_path / "run")]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "run").exists()


def test_a_diagnosis_names_the_law_that_is_missing_and_the_load_where_the_gap_lies(files, tmp_path, capsys):
    given = [*map(str, files[::2]), "--model", "kelvin_voigt_damper", "--over", "vertical_force", "--law", "c=constant"]
    assert main(["diagnose", *given, "--jobs", "1", "--out", str(tmp_path / "page")]) == 0
    found = json.loads((tmp_path / "page" / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] == "effect"
    (effect,) = found["effects"]
    assert effect["name"] == "law:c/vertical_force"
    assert effect["size_low"] < 0.3 < effect["size_high"]
    low, middle, high = found["where"]["conditions"]
    assert (low["value"], middle["value"], high["value"]) == LOADS
    assert middle["gap"] < 0.5 * min(low["gap"], high["gap"])  # a law leaves nothing at the middle
    assert "vertical_force" in capsys.readouterr().out
    page = (tmp_path / "page" / "diagnosis.html").read_text(encoding="utf-8")
    assert "The gap is largest under a vertical force of 4" in page


@pytest.mark.slow
def test_a_diagnosis_with_laws_finds_no_gap(files, tmp_path):
    given = [*map(str, files[::2]), "--model", "kelvin_voigt_damper", "--over", "vertical_force", "--effects", "delay"]
    assert main(["diagnose", *given, "--jobs", "1", "--out", str(tmp_path / "page")]) == 0
    found = json.loads((tmp_path / "page" / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] == "none"


def test_loads_that_scatter_about_a_set_point_are_one_combination(tmp_path):
    tests = [
        replace(
            measurement,
            experiment=replace(
                measurement.experiment,
                name=f"{load:g} {measurement.name}",
                conditions={"vertical_force": load + off, "temperature": 300.0},
            ),
        )
        for load in LOADS[:2]
        for off, measurement in zip((-5.0, 5.0), damper(load, 300.0, 7).measurements, strict=True)
    ]
    whole = Campaign("damper", "simulated", {}, tuple(tests))
    laws = {"c": "linear", "d": "linear", "others": "constant"}
    settings = Settings(over=("vertical_force",), laws=laws, fixed={"p": 0.0}, sample=False, jobs=1, evaluations=200)
    run, tree = identify(whole, "kelvin_voigt_damper", settings, out=tmp_path / "run")
    assert tree["laws/cells"].dataset["vertical_force"].values == pytest.approx(LOADS[:2])
    found = [one["text"] for one in summary(tree, run)["findings"] if one["kind"] == "set_points"]
    assert [text.partition(" count")[0] for text in found] == [
        f"vertical_force: {load - 5:g}, {load + 5:g}" for load in LOADS[:2]
    ]
    told = diagnose(whole, "kelvin_voigt_damper", ["delay"], settings=settings)
    assert told.warnings[:2] == tuple(found)
