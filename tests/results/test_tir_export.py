"""Property files: patched with what a run supports, read back by a parser and Magic Formula of the test's own."""

import math
import re

import numpy as np
import pytest
from tyre_runs import TRUE, tyre_run

from mofit.cli import main
from mofit.errors import InputError
from mofit.models import find_model
from mofit.prediction.tyre_draws import tyre_draws
from mofit.results import write_result
from mofit.results.tir_entries import tir_replacements
from mofit.results.tir_file import TirFile

MF_61 = """$ a rig's template, 205/55 R16\r
[UNITS]\r
LENGTH = 'meter'\r
FORCE  = 'newton'\r
ANGLE  = 'radians'\r
[MODEL]\r
FITTYP = 61        $Magic Formula version\r
[DIMENSION]\r
UNLOADED_RADIUS = 0.3135\r
[VERTICAL]\r
FNOMIN = 4200\r
[STRUCTURAL]\r
LATERAL_STIFFNESS      = 100000   $ to be replaced\r
PCFY1 = 0.05\r
PCFY2 = 0.01\r
[SCALING_COEFFICIENTS]\r
LFZO = 1.0\r
LKY = 0.95\r
[LATERAL_COEFFICIENTS]\r
PCY1 = 1.3 $ shape \xe9\r
PKY1 = -15.5  $ largest cornering stiffness over nominal load\r
PKY2 =  1.7\r
PKY4 = 2\r
PTY1 = 2.1\r
"""
MF_52 = (
    MF_61.replace("\r\n", "\n")
    .replace("FITTYP = 61 ", "FITTYP = 6 ")
    .replace("PTY1 = 2.1", "PTY1 = 2.1\nPTY2 = 2.0\nPKX1 = 20\nPKX2 = -1\nPKX3 = 0.2")
)
ROLLING = {"longitudinal_velocity": 60 / 3.6}
LOADED = {**ROLLING, "vertical_force": 4000.0, "nominal_vertical_force": 4000.0}


def parsed(text: str) -> dict[str, float]:
    """An independent reader: section heads, comments after $ or !, the rest KEY = VALUE."""
    found = {}
    for raw in re.split(r"\r\n|\n", text):
        line = re.split(r"[$!]", raw)[0].strip()
        if "=" in line:
            key, value = (part.strip() for part in line.split("=", 1))
            found[key] = value.strip("'") if value.startswith("'") else float(value)
    return found


def cornering(mf: dict, load: float) -> float:
    """K_y of Magic Formula at zero camber."""
    base = mf["FNOMIN"] * mf["LFZO"]
    return mf["PKY1"] * base * math.sin(mf["PKY4"] * math.atan(load / (mf["PKY2"] * base))) * mf["LKY"]


def relaxation(mf: dict, load: float) -> float:
    """Relaxation length of Magic Formula 5.2."""
    base = mf["FNOMIN"] * mf["LFZO"]
    return mf["PTY1"] * math.sin(2 * math.atan(load / (mf["PTY2"] * base))) * mf["UNLOADED_RADIUS"] * mf["LFZO"]


def lateral(mf: dict, load: float) -> float:
    change = load / (mf["FNOMIN"] * mf["LFZO"]) - 1
    return mf["LATERAL_STIFFNESS"] * (1 + mf["PCFY1"] * change + mf["PCFY2"] * change**2)


@pytest.fixture(scope="module")
def one_load():
    return tyre_run("maxwell_tyre", [ROLLING])


@pytest.fixture(scope="module")
def over_load():
    return tyre_run("maxwell_tyre_over_load", [LOADED])


def patched(tree, text, load=None):
    name = str(tree.attrs["model"])
    tir = TirFile.of_bytes(text.encode("latin-1"), "file 'in.tir'")
    new, kept = tir_replacements(tir, tyre_draws(tree, find_model(name), load))
    return tir.patched(new).decode("latin-1"), new, kept


def test_every_other_byte_stays(one_load, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_result(one_load, tmp_path / "run")
    (tmp_path / "in.tir").write_bytes(MF_61.encode("latin-1"))
    command = ["export", "run", "--to", "tir", "--template", "in.tir", "--load", "3.6 kN", "--out", "out.tir"]
    assert main(command) == 0
    said = capsys.readouterr().err
    assert "PTY1: Magic Formula 6.1 takes the relaxation length from stiffnesses" in said
    assert "PKX1: the template does not have it" in said
    lines = (tmp_path / "out.tir").read_bytes().decode("latin-1").split("\r\n")
    kept = [line for line in lines if not line.startswith("$ mofit:")]
    changed = [k for k, pair in enumerate(zip(kept, MF_61.split("\r\n"), strict=True)) if pair[0] != pair[1]]
    assert [kept[k].split()[0] for k in changed] == ["LATERAL_STIFFNESS", "PKY1"]
    # the comment behind the number is still there, and one above tells the interval
    assert kept[changed[0]].endswith("   $ to be replaced")
    above = lines[lines.index(kept[changed[1]]) - 1]
    low, high = map(float, re.search(r"5 to 95 %: (\S+) to (\S+), was -15\.5", above).groups())
    value = parsed("\r\n".join(lines))["PKY1"]
    assert min(low, high) < value < max(low, high)
    assert (max(low, high) - min(low, high)) / abs(value) == pytest.approx(2 * 1.645 * 0.01, rel=0.15)
    # an input is never replaced
    assert main([*command[:-1], "in.tir"]) == 2
    assert (tmp_path / "in.tir").read_bytes() == MF_61.encode("latin-1")


def test_one_load_gives_stiffness_and_relaxation_at_that_load(one_load):
    for text in (MF_61, MF_52):
        mf = parsed(patched(one_load, text, 3600.0)[0])
        # the sign is the template's
        assert cornering(mf, 3600.0) == pytest.approx(-TRUE["dF0"], rel=2e-3)
        assert lateral(mf, 3600.0) == pytest.approx(TRUE["c_y"], rel=2e-3)
        assert (mf["PKY2"], mf["PCFY1"]) == (1.7, 0.05)
    assert relaxation(mf, 3600.0) == pytest.approx(TRUE["dF0"] / TRUE["c_y"], rel=3e-3)
    assert mf["PTY2"] == 2.0


def test_a_run_over_load_gives_the_laws(over_load):
    for text in (MF_61, MF_52):
        mf = parsed(patched(over_load, text)[0])
        for load, k, c in ((4000.0, "dF0_N", "c_y_N"), (8000.0, "dF0_2N", "c_y_2N")):
            assert cornering(mf, load) == pytest.approx(-TRUE[k], rel=5e-3)
            assert lateral(mf, load) == pytest.approx(TRUE[c], rel=5e-3)
            if text == MF_52:
                assert relaxation(mf, load) == pytest.approx(TRUE[k] / TRUE[c], rel=5e-3)


def test_longitudinal_slip_stiffness():
    mf = parsed(patched(tyre_run("maxwell_tyre_longitudinal", [ROLLING]), MF_52, 3000.0)[0])
    change = 3000.0 / 4200 - 1
    assert 3000.0 * (mf["PKX1"] - change) * math.exp(0.2 * change) == pytest.approx(TRUE["dF0_x"], rel=2e-3)


def test_what_is_not_identified_stays():
    tree = tyre_run("maxwell_tyre", [ROLLING], not_identified=["c_y"])
    text, new, kept = patched(tree, MF_52, 3600.0)
    assert set(new) == {"PKY1"}
    assert kept["LATERAL_STIFFNESS"] == "c_y is not identifiable" == kept["PTY1"]
    assert parsed(text)["PTY1"] == 2.1
    nothing = tyre_run("maxwell_tyre", [ROLLING], not_identified=["c_y", "dF0"])
    with pytest.raises(InputError, match=r"supports none of its coefficients \(PKY1: dF0 is not identifiable"):
        patched(nothing, MF_52, 3600.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FITTYP = 61 ", "FITTYP = 70 ", "FITTYP is 70"),
        ("FITTYP = 61 ", "FITTY = 61 ", "it has no FITTYP"),
        ("'newton'", "'pound_force'", "its unit of force is 'pound_force'"),
        ("FNOMIN = 4200", "FNOMIN =  many", "FNOMIN is given twice or is no number"),
    ],
)
def test_templates_that_cannot_be_patched(one_load, old, new, message):
    with pytest.raises(InputError, match=message):
        patched(one_load, MF_61.replace(old, new), 3600.0)


def test_signs_need_numbers_in_the_template(one_load):
    _, new, kept = patched(one_load, MF_61.replace("PKY1 = -15.5", "PKY1 = 0"), 3600.0)
    assert "signs are not known" in kept["PKY1"]
    assert set(new) == {"LATERAL_STIFFNESS"}


@pytest.mark.parametrize(
    ("name", "load", "message"),
    [
        ("maxwell_tyre", None, "does not read the vertical force"),
        ("maxwell_tyre", -5.0, "not above 0"),
        ("maxwell_tyre_over_load", 3600.0, "reads the load of every test"),
    ],
)
def test_the_load_must_be_known_once(one_load, over_load, name, load, message):
    tree = one_load if name == "maxwell_tyre" else over_load
    with pytest.raises(InputError, match=message):
        tyre_draws(tree, find_model(name), load)


def test_options_of_other_formats_are_refused(tmp_path, capsys):
    assert main(["export", str(tmp_path), "--to", "csv", "--load", "3 kN"]) == 2
    assert "--load 3 kN: is for tir, not for csv" in capsys.readouterr().err
    assert np.all([not file.name.endswith("csv") for file in tmp_path.iterdir()])
