"""The command predict: folder, page, JSON, and one message where the input is wrong."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from damper_rig import damper_campaign
from published_schemas import violations

import mofit
from mofit.cli import main
from mofit.data import Campaign, import_files
from mofit.identification.settings import Settings
from mofit.results import prediction_rows
from mofit.results.prediction_schema import HELD_OUT, RECORD

MODEL = "kelvin_voigt_damper"
MAPS = Path(__file__).resolve().parents[2] / "data" / "maps"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A finished run, and a campaign file."""
    folder = tmp_path_factory.mktemp("predict")
    campaign = damper_campaign()
    mofit.write_campaign(campaign, folder / "damper.nc")
    settings = Settings(jobs=1, sample=False, evaluations=200)
    mofit.identify(campaign, MODEL, settings, tests=["0.5Hz", "1Hz"], out=folder / "run")
    return folder / "run", folder / "damper.nc"


@pytest.fixture
def empty(tmp_path, monkeypatch):
    folder = tmp_path / "cwd"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def test_a_prediction_is_a_folder_with_file_and_page(run, empty, capsys):
    result, file = run
    assert main(["predict", str(result), str(file), "--out", "new", "--jobs", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "mofit.prediction/1"
    assert not violations(found)
    assert found["folder"] == "new"
    assert [row["test"] for row in found["tests"]] == ["0.5Hz", "1Hz", "2Hz", "4Hz"]
    assert {*found["tests"][0]} == {
        "test", "output", "unit", "role", "scored_from", "nrmsd", "rms", "coverage", "range", "parameter_sd",
        "noise_sd", "model_error", "scoped",
    }  # fmt: skip
    assert {path.name for path in (empty / "new").iterdir()} == {
        "prediction.nc", "prediction.html", "prediction_data"
    }  # fmt: skip
    page = (empty / "new" / "prediction.html").read_text()
    assert re.findall(r'<section id="(\w+)"', page) == ["summary", "signals", "method"]
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert page.count("Good:") == page.count("Bad:") == 1
    assert "did not converge" in page


def test_the_file_keeps_its_layout(run, empty):
    result, file = run
    assert main(["predict", str(result / "result.nc"), str(file), "--test", "2Hz", "--out", "new"]) == 0
    with xr.open_datatree(empty / "new" / "prediction.nc", engine="netcdf4") as tree:
        assert set(tree.dataset.data_vars) == set(HELD_OUT.variables)
        assert set(tree["tests/2Hz"].dataset.data_vars) == set(RECORD.variables)
        for node in tree.subtree:
            for name, variable in node.to_dataset(inherit=False).variables.items():
                assert variable.attrs["units"], name
                assert variable.attrs["long_name"], name
        own = tree["tests/2Hz"].dataset
        np.testing.assert_allclose(own["residual"], own["measured"] - own["median"])
        assert (own["low"] <= own["parameter_low"]).all()
        assert (own["parameter_high"] <= own["high"]).all()


def test_predictions_go_into_the_run_and_replace_nothing(run, empty, capsys):
    result, file = run
    before = {path: path.read_bytes() for path in result.iterdir() if path.is_file()}
    for _ in range(2):
        assert main(["predict", str(result), str(file), "--test", "1Hz"]) == 0
    assert {path.name for path in (result / "predictions").iterdir()} == {"damper", "damper-2"}
    assert all(path.read_bytes() == content for path, content in before.items())
    assert "in the 90 % band" in capsys.readouterr().out
    taken = str(result / "predictions" / "damper")
    assert main(["predict", str(result), str(file), "--out", taken]) == 2
    assert "exists already" in capsys.readouterr().err


def test_wrong_inputs_are_one_message_and_nothing_is_written(run, empty, tmp_path, capsys):
    result, file = run
    lacking, source = tmp_path / "lacking.nc", damper_campaign().measurements[0]
    experiment = replace(source.experiment, inputs={"slip_angle": source.experiment.inputs["displacement"]})
    other = replace(source, experiment=experiment, units={"slip_angle": "rad", "force": "N"})
    mofit.write_campaign(Campaign("lacking", "simulated", {}, (other,)), lacking)
    before = sorted(tmp_path.rglob("*"))
    for arguments, *words in (
        (["absent", file], "absent"),
        ([result, "absent.nc"], "absent.nc"),
        ([file, file], "schema"),
        ([result, lacking, "--out", "new"], "displacement", "0.5Hz"),
        ([result, file, "--test", "2hz", "--out", "new"], "2Hz"),
        ([result, file, "--model", "maxwell_tyre", "--out", "new"], "equations"),
        ([result, file, "--effect", "force_ofset", "--out", "new"], "force_offset"),
        ([result, file, "--jobs", "0"], "--jobs 0"),
    ):
        assert main(["predict", *map(str, arguments)]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith("mofit: ")
        assert "Traceback" not in err
        for word in words:
            assert word in err, err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
def test_an_earthquake_from_sines(shared_data, tmp_path):
    """A friction damper as a Kelvin–Voigt damper: the wrong model, whose error the sines tell."""
    folder = shared_data / "friction_damper"
    if not folder.is_dir():
        pytest.skip("no measured data: ../shared/data/friction_damper is absent")
    campaign = import_files([folder], MAPS / "friction_damper.toml")
    settings = Settings(jobs=1, sample=False, evaluations=200)
    sines = [test.name for test in campaign.measurements if test.kind == "sine"]
    _, tree = mofit.identify(campaign, MODEL, settings, tests=sines, hold_out="earthquake", out=tmp_path / "run")
    rows = {row["test"]: row for row in prediction_rows(tree["held_out"])}
    assert rows["earthquake"]["role"] == "held out"
    assert rows["earthquake"]["nrmsd"] < 0.15
    assert rows["earthquake"]["coverage"] > 0.8
    assert rows["earthquake"]["model_error"] > rows["earthquake"]["noise_sd"]


#: names of variables and groups of a file, markup, and broken math
@pytest.mark.parametrize("name", ["range", "prediction", "t <script>alert(1)<", r"t $\frac{x$"])
def test_any_name_of_a_test_is_predicted(run, empty, name):
    result, _ = run
    first = damper_campaign().measurements[0]
    records = Campaign(name, "simulated", {}, (replace(first, experiment=replace(first.experiment, name=name)),))
    mofit.write_campaign(records, empty / "named.nc")
    assert main(["predict", str(result), "named.nc", "--out", "new"]) == 0
    with xr.open_datatree(empty / "new" / "prediction.nc", engine="netcdf4") as tree:
        assert list(tree["tests"].children) == [name]
    assert "<script>alert" not in (empty / "new" / "prediction.html").read_text()
