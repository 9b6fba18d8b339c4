"""From a campaign to an FMU on the command line, and the FMU against the prediction that the run holds."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from fmu_runs import drive, fmpy, needs_compiler, run
from lag_rig import MODEL, campaign
from published_schemas import violations

from mofit.cli import main
from mofit.data import write_campaign
from mofit.results import open_result
from mofit.results.export import model_of_run
from mofit.simulation import ExperimentData

BUNDLED = Path(__file__).parents[2] / "data" / "paper_campaign.nc"


def deviation(path, folder, model, test, conditions):
    """Largest difference of an FMU, at the MAP estimate, from the run's simulation of a test, as a share of its range.

    The FMU is driven by the inputs that the run holds.
    """
    tree = open_result(folder)
    data, wanted = tree["constant_data"].dataset, tree["modes/m1/prediction"].dataset[test].values
    time = data[f"time_{test}"].values
    inputs = np.stack([data[f"{test}_{channel.name}"].values for channel in model.inputs], axis=1)
    nothing = np.zeros((len(time), 1))
    step = float(time[1] - time[0])
    driven = ExperimentData(test, step, inputs, "cubic", np.array(conditions), nothing, nothing)
    best = tree["modes/m1"].dataset["value"]
    values = {str(name): float(best.sel(parameter=name)) for name in best["parameter"].values}
    found = run(path, drive(tree, model, driven), step, start_values=values)
    return np.max(np.abs(found - wanted)) / np.ptp(wanted)


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_fmu_of_ones_own_model_gives_the_prediction_of_its_run(lag, fmi, capsys):
    folder, reference = lag
    out = folder.parent / f"lag{fmi}.fmu"
    command = ["export", folder, "--to", "fmu", "--fmi", fmi, "--model", reference, "--out", out, "--json"]
    assert main([*map(str, command)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert not violations(said)
    assert (said["file"], said["fmi"], said["mode"], said["note"]) == (str(out), fmi, "m1", None)
    assert fmpy.supported_platforms(str(out)) != ["c-code"]
    (temperature,) = (v for v in fmpy.read_model_description(str(out)).modelVariables if v.name == "temperature")
    assert (float(temperature.start), temperature.unit) == (300.0, "K")
    model = model_of_run(open_result(folder), reference)
    assert deviation(out, folder, model, "sine_1Hz", [300.0]) < 1e-6


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    """A finished run of a model in a file, and the reference of the model; its gain falls with the temperature."""
    folder = tmp_path_factory.mktemp("lag")
    write_campaign(campaign(conditions={"temperature": 300.0}), folder / "rig.nc")
    text = MODEL.replace("import Channel", "import Channel, Condition").replace("s.k *", "s.k * 300 / s.temperature *")
    text = text.replace("    inputs =", '    conditions = (Condition("temperature", "K"),)\n    inputs =')
    (folder / "lag.py").write_text(text)
    reference, out = f"{folder / 'lag.py'}:Lag", folder / "run"
    identify = ["identify", folder / "rig.nc", "--model", reference, "--out", out, "--no-sample", "--seed", "1"]
    assert main([*map(str, identify)]) in (0, 3)
    return out, reference


def test_without_a_compiler_the_command_says_what_the_fmu_lacks(lag, tmp_path, monkeypatch, capsys):
    folder, reference = lag
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    out = tmp_path / "lag.fmu"
    command = ["export", folder, "--to", "fmu", "--model", reference, "--out", out]
    assert main([*map(str, command)]) == 0
    said = capsys.readouterr()
    assert said.out.strip() == str(out)
    assert "no C compiler was found" in said.err
    assert fmpy.supported_platforms(str(out)) == ["c-code"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--to", "c", "--fmi", "2"], "--fmi 2: is for fmu, not for c"),
        (["--to", "toml", "--test", "sine_1Hz"], "--test sine_1Hz: is for fmu and tydex, not for toml"),
        (["--to", "fmu", "--test", "sine_9Hz"], "--test sine_9Hz: the run has no such test"),
        (["--to", "fmu", "--mode", "m7"], "--mode m7: the run has no such mode"),
        (["--to", "fmu", "--model", "maxwell_damper"], "not those that the run identified"),
    ],
)
def test_what_cannot_be_exported_is_refused_and_nothing_written(lag, options, message, tmp_path, monkeypatch, capsys):
    folder, reference = lag
    monkeypatch.chdir(tmp_path)
    model = [] if "--model" in options else ["--model", reference]
    assert main(["export", str(folder), *options, *model]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())


@needs_compiler
@pytest.mark.slow
def test_the_fmu_of_the_bundled_campaign_gives_the_predictions_of_its_run(tmp_path):
    folder = tmp_path / "run"
    shutil.copy(BUNDLED, tmp_path / "paper.nc")
    assert main(["identify", str(tmp_path / "paper.nc"), "--out", str(folder), "--no-sample", "--seed", "0"]) in (0, 3)
    out = tmp_path / "tyre.fmu"
    assert main(["export", str(folder), "--to", "fmu", "--out", str(out)]) == 0
    tree = open_result(folder)
    model = model_of_run(tree)
    known = tree["conditions"].dataset
    for test in map(str, tree["test"].values):
        conditions = known["value"].sel(test=test).values
        assert deviation(out, folder, model, test, conditions) < 1e-6
