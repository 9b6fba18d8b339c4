import csv
import io
import json
import tomllib
from pathlib import Path

import pytest
import xarray as xr
from published_schemas import violations
from result_trees import make_result
from synthetic_rigs import tyre

from mofit.cli import main
from mofit.results import quantity, summary, write_result
from mofit.results.export import parameters_csv, parameters_toml


@pytest.fixture(scope="module")
def tree():
    tree = make_result(tyre(), clusters=2)
    configuration = {**json.loads(tree.attrs["configuration"]), "fixed": {"c_z": 12.5}}
    tree.attrs["configuration"] = json.dumps(configuration)
    tree["fixed"] = xr.DataTree(xr.Dataset({"c_z": quantity((), 12.5, "N/m", "vertical stiffness")}))
    return tree


def modes(tree):
    return {mode["id"]: mode for mode in summary(tree, Path())["modes"]}


def test_toml_holds_every_number_in_full(tree):
    read = tomllib.loads(parameters_toml(tree))
    assert list(read["modes"]) == ["m1", "m2"]
    for name, mode in modes(tree).items():
        assert read["modes"][name]["probability"] == mode["probability"]
        assert read["modes"][name]["nrmsd"] == mode["nrmsd"]
        for parameter, entry in mode["parameters"].items():
            known = {
                key: value for key, value in entry.items() if value is not None and key not in ("spread", "at_bound")
            }
            assert read["modes"][name]["parameters"][parameter] == known
    assert read["modes"]["m1"]["parameters"]["c_z"] == {"value": 12.5, "unit": "N/m", "verdict": "fixed"}
    assert (read["seed"], read["converged"]) == (7, True)


def test_csv_holds_every_number_in_full(tree):
    rows = list(csv.DictReader(io.StringIO(parameters_csv(tree))))
    found = {(row["mode"], row["parameter"]): row for row in rows}
    for name, mode in modes(tree).items():
        for parameter, entry in mode["parameters"].items():
            row = found[name, parameter]
            assert (row["unit"], row["verdict"], float(row["probability"])) == (
                entry["unit"], entry["verdict"], mode["probability"],
            )  # fmt: skip
            for key in ("value", "mean", "sd", "q05", "q50", "q95"):
                assert float(row[key]) == entry[key]
    assert found["m2", "c_z"]["value"] == "12.5"
    assert found["m2", "c_z"]["sd"] == ""
    assert found["m2", "c_z"]["unit"] == "N/m"


def test_the_command_writes_a_new_file_and_says_where(tree, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_result(tree, tmp_path / "run")
    assert main(["export", "run", "--to", "csv", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert not violations(said)
    assert (said["file"], said["mode"]) == ("maxwell.csv", None)
    assert (tmp_path / "maxwell.csv").read_text() == parameters_csv(tree)
    assert main(["export", "run", "--to", "csv"]) == 2
    assert "exists already" in capsys.readouterr().err
    # the model of this run is no shipped one
    assert main(["export", "run", "--to", "c"]) == 2
    assert "unknown name" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["maxwell.csv", "run"]
