import csv
import io
import json
import sys
import tomllib
from pathlib import Path

import pytest
import xarray as xr

sys.path.insert(0, str(Path(__file__).parents[1] / "result"))
from result_trees import make_result
from synthetic_rigs import tyre

from mofit.cli import main
from mofit.export import parameters_csv, parameters_toml
from mofit.result import quantity, write_result
from mofit.summary import summary


@pytest.fixture(scope="module")
def tree():
    tree = make_result(tyre(), clusters=2)
    configuration = {**json.loads(tree.attrs["configuration"]), "fixed": {"c_z": 12.5}}
    tree.attrs["configuration"] = json.dumps(configuration)
    tree["held"] = xr.DataTree(xr.Dataset({"c_z": quantity((), 12.5, "N/m", "vertical stiffness")}))
    return tree


def modes(tree):
    return {mode["id"]: mode for mode in summary(tree, Path())["modes"]}


def test_toml_holds_every_number_in_full(tree):
    read = tomllib.loads(parameters_toml(tree))
    assert list(read["modes"]) == ["c1", "c2"]
    for name, mode in modes(tree).items():
        assert read["modes"][name]["weight"] == mode["weight"]
        assert read["modes"][name]["nrmsd"] == mode["nrmsd"]
        for parameter, entry in mode["parameters"].items():
            known = {key: value for key, value in entry.items() if value is not None}
            assert read["modes"][name]["parameters"][parameter] == known
    assert read["modes"]["c1"]["parameters"]["c_z"] == {"value": 12.5, "unit": "N/m", "verdict": "held"}
    assert (read["seed"], read["converged"]) == (7, True)


def test_csv_holds_every_number_in_full(tree):
    rows = list(csv.DictReader(io.StringIO(parameters_csv(tree))))
    found = {(row["mode"], row["parameter"]): row for row in rows}
    for name, mode in modes(tree).items():
        for parameter, entry in mode["parameters"].items():
            row = found[name, parameter]
            assert (row["unit"], row["verdict"], float(row["weight"])) == (
                entry["unit"], entry["verdict"], mode["weight"],
            )  # fmt: skip
            for key in ("value", "mean", "sd", "q05", "q50", "q95"):
                assert float(row[key]) == entry[key]
    assert found["c2", "c_z"]["value"] == "12.5"
    assert found["c2", "c_z"]["sd"] == ""
    assert found["c2", "c_z"]["unit"] == "N/m"


def test_the_command_writes_a_new_file_and_says_where(tree, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_result(tree, tmp_path / "run")
    assert main(["export", "run", "--to", "csv", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["file"] == "maxwell.csv"
    assert (tmp_path / "maxwell.csv").read_text() == parameters_csv(tree)
    assert main(["export", "run", "--to", "csv"]) == 2
    assert "exists already" in capsys.readouterr().err
    # the model of this run is no shipped one
    assert main(["export", "run", "--to", "c"]) == 2
    assert "unknown name" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["maxwell.csv", "run"]
