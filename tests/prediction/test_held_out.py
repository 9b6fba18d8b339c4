"""Tests held out of an identification: not used, predicted as the command predicts them, and told beside the others."""

import json
import re

import numpy as np
import pytest
import straight_line
from damper_rig import damper_campaign
from published_schemas import violations

import mofit
from mofit.cli import main
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.results import prediction_rows

FAST = Settings(jobs=1, sample=False, evaluations=200)
MODEL = "kelvin_voigt_damper"


@pytest.fixture
def campaign_file(tmp_path):
    mofit.write_campaign(damper_campaign(), tmp_path / "damper.nc")
    return tmp_path / "damper.nc"


def test_the_test_is_not_used_and_predicted_as_the_command_does(campaign_file, tmp_path):
    whole = mofit.read_campaign(campaign_file)
    folder, tree = mofit.identify(whole, MODEL, FAST, hold_out="2Hz", out=tmp_path / "held")
    rest = whole.select([name for name in whole.tests if name != "2Hz"])
    _, without = mofit.identify(rest, MODEL, FAST, out=tmp_path / "without")
    np.testing.assert_array_equal(tree["modes/m1/value"], without["modes/m1/value"])
    assert "2Hz" not in tree["test"].values
    rows = {row["test"]: row for row in prediction_rows(mofit.open(folder)["held_out"])}
    assert {name: row["role"] for name, row in rows.items()} == {
        "2Hz": "held out", "0.5Hz": "fitted", "1Hz": "fitted", "4Hz": "fitted"
    }  # fmt: skip
    (predicted,) = prediction_rows(mofit.predict(folder, whole, tests=["2Hz"]))
    assert {**predicted, "role": "held out"} == rows["2Hz"]
    assert rows["2Hz"]["coverage"] == pytest.approx(0.9, abs=0.05)
    assert list(tree["held_out/tests"].children) == ["2Hz"]


@pytest.mark.slow
def test_terminal_json_and_report_tell_of_it(campaign_file, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = ["--hold-out", "2Hz", "--no-sample", "--jobs", "1", "--evaluations", "200"]
    assert main(["identify", str(campaign_file), "--model", MODEL, *options, "--out", "run"]) == 3
    line = next(line for line in capsys.readouterr().out.splitlines() if "held out" in line and "2Hz" in line)
    assert line.split()[0] == "2Hz"
    assert main(["identify", str(campaign_file), "--model", MODEL, *options, "--out", "again", "--json"]) == 3
    printed = json.loads(capsys.readouterr().out)
    assert not violations(printed)
    found = printed["held_out"]
    assert {row["test"] for row in found["tests"] if row["role"] == "held out"} == {"2Hz"}
    page = (tmp_path / "run" / "report.html").read_text()
    assert '<section id="held_out"' in page
    assert page.count("Good:") == page.count("Bad:")
    assert json.loads((tmp_path / "run" / "report_data" / "held_out.json").read_text())["tests"] == found["tests"]
    assert main(["report", "run"]) == 0
    assert '<section id="held_out"' in (tmp_path / "run" / "report.html").read_text()
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(address.startswith(("data:", "#")) for address in addresses)


@pytest.mark.parametrize(
    ("tests", "hold_out", "words"),
    [
        ((), ["2hz"], "Did you mean '2Hz'"),
        ((), ["0.5Hz", "1Hz", "2Hz", "4Hz"], "leaves no test to identify from"),
        (["1Hz"], ["1Hz"], "leaves no test to identify from"),
    ],
)
def test_what_cannot_be_held_out_is_refused(tests, hold_out, words, tmp_path):
    with pytest.raises(InputError, match=words):
        mofit.identify(damper_campaign(), MODEL, FAST, tests=tests, hold_out=hold_out, out=tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_test_without_the_output_cannot_be_held_out(tmp_path):
    records = straight_line.campaign(
        straight_line.sine_test(), straight_line.unmeasured(straight_line.sine_test("blind"))
    )
    with pytest.raises(InputError, match="channel 'force'"):
        mofit.identify(records, straight_line.StraightLine(), FAST, hold_out="blind", out=tmp_path / "run")
