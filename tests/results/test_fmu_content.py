"""What an FMU says and holds: numbers, units, hostile names, sources, and a binary only where a compiler works."""

import re
import shutil
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from fmu_runs import (
    ROLLING,
    drive,
    fmpy,
    fmu_of,
    needs_compiler,
    record,
    run,
    run_of,
    simulated,
    steer,
    stroke,
    validate_fmu,
)
from simulators import line_simulator

from mofit.errors import InputError
from mofit.models import Channel, Condition, Equations, Model, find_effect, find_model, with_effects
from mofit.parameters import Parameter
from mofit.results.export import require_equations
from mofit.results.fmu.archive import write_fmu
from mofit.results.fmu.values import condition_starts, parameter_starts
from mofit.results.fmu.variables import contents


@pytest.fixture
def without_compiler(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)


def variables(path):
    return {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_parameters_start_at_the_posterior_mean_and_tell_their_interval(without_compiler, fmi, tmp_path):
    model = find_model("maxwell_tyre")
    test = record(model, steer(), 0.01, list(ROLLING.values()))
    tree = run_of(model, {"p_y": -7.5}, {name: [value] for name, value in ROLLING.items()}, {"drive": test})
    found = variables(fmu_of(tree, model, tmp_path, fmi=fmi))
    own = found["d_M"]
    assert (own.causality, own.variability, own.unit) == ("parameter", "tunable", "N s/m")
    assert float(own.start) == 8e3
    assert "90 % interval 6720 to 9280, identified" in own.description
    assert (float(own.min), own.max) == (0.0, None)  # a log scale is positive
    assert (float(found["p_y"].start), found["p_y"].min, found["p_y"].max) == (-7.5, None, None)
    speed = found["longitudinal_velocity"]
    assert (speed.causality, speed.unit, float(speed.start)) == ("parameter", "m/s", 60 / 3.6)
    assert "common to the tests" in speed.description
    assert float(found["slip_angle"].nominal) == pytest.approx(np.max(np.abs(test.inputs)))
    # the deflection that the model reaches in this test, at most force over stiffness
    assert 1e-3 < float(found["lateral_deflection"].nominal) < 0.03
    assert [name for name, v in found.items() if v.causality == "output"] == ["lateral_force"]


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_units_are_told_in_base_units(without_compiler, fmi, tmp_path):
    model = find_model("maxwell_damper")
    path = fmu_of(run_of(model, tests={"drive": record(model, stroke(), 0.002)}), model, tmp_path, fmi=fmi)
    root = ElementTree.fromstring(zipfile.ZipFile(path).read("modelDescription.xml"))
    base = {unit.get("name"): unit.find("BaseUnit").attrib for unit in root.iter("Unit")}
    assert base["N s/m"] == {"kg": "1", "s": "-1"}
    assert base["N/m^2"] == {"kg": "1", "m": "-1", "s": "-2"}
    assert base["m/s^2"] == {"m": "1", "s": "-2"}


def test_a_derivative_that_the_model_reads_has_its_own_name(without_compiler, tmp_path):
    model = find_model("maxwell_damper")
    found = variables(fmu_of(run_of(model), model, tmp_path))
    inputs = [name for name, v in found.items() if v.causality == "input"]
    assert inputs == ["displacement", "velocity", *(f"der(displacement,{k})" for k in (2, 3, 4))]


class Hostile(Model):
    """Names and units that neither XML nor C nor FMI takes as they are."""

    name = '3 / */ "<&>" ζ'
    title = "a <b>&amp; \x01 title"
    parameters = (
        Parameter("k <&>\"' 1", "furlong<&>", 1.0, 3.0, 2.0, description="stiff\x00ness\nof *\u0002/"),
        Parameter("time", "s", 0.1, 1.0, 0.5),
        Parameter("ζ", "", 0.1, 1.0, 0.5),
        Parameter("double", "m^0.5", 0.1, 1.0, 0.5),
    )
    states = (Channel("x\ty", "mystery"),)
    inputs = (Channel("Weg [mm]", "m"),)
    outputs = (Channel("x y", "N"),)
    conditions = (Condition("main", "K", 300.0),)

    def equations(self, s):
        k, x, weg = (getattr(s, name) for name in ("k <&>\"' 1", "x\ty", "Weg [mm]"))
        return Equations({"x y": k * x + s.double * s.main}, {"x\ty": (weg - x) / (s.time + s.ζ)})


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_hostile_names_and_units_make_a_valid_fmu(fmi, tmp_path):
    model = Hostile()
    test = record(model, [np.sin(3 * np.arange(200) * 0.01)], 0.01, [300.0])
    tree = run_of(model, None, {"main": [300.0]}, {"drive": test})
    path = fmu_of(tree, model, tmp_path, fmi=fmi)
    assert validate_fmu(str(path)) == []
    found = variables(path)
    assert {"k <&>\"' 1", "time_2", "ζ", "Weg [mm]", "x y", "x y_2", "der(Weg [mm],2)"} <= set(found)
    assert found["k <&>\"' 1"].unit == "furlong<&>"
    assert run(path, drive(tree, model, test), 0.01) == pytest.approx(simulated(model, test), abs=1e-6)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_without_a_compiler_the_fmu_holds_sources_and_says_so(without_compiler, fmi, tmp_path):
    model = find_model("maxwell_damper")
    built = write_fmu(run_of(model), model, tmp_path / "damper.fmu", fmi=fmi)
    assert built.platform is None
    assert "no C compiler was found" in built.note
    assert validate_fmu(str(tmp_path / "damper.fmu")) == []
    names = zipfile.ZipFile(tmp_path / "damper.fmu").namelist()
    assert not [name for name in names if name.startswith("binaries")]
    assert ("sources/buildDescription.xml" in names) == (fmi == "3")


def test_a_compiler_that_fails_leaves_sources(monkeypatch, tmp_path):
    broken = tmp_path / "broken cc"
    broken.write_text("#!/bin/sh\necho 'fatal error: no headers' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", f"'{broken}' -m32")
    model = find_model("maxwell_damper")
    built = write_fmu(run_of(model), model, tmp_path / "damper.fmu")
    assert built.platform is None
    assert "fatal error: no headers" in built.note


@needs_compiler
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake on this machine")
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_sources_can_be_compiled_by_an_importer(fmi, tmp_path, monkeypatch):
    build = pytest.importorskip("fmpy.build")
    model = find_model("maxwell_tyre")
    test = record(model, steer(), 0.01, list(ROLLING.values()))
    tree = run_of(model, None, {name: [value] for name, value in ROLLING.items()}, {"drive": test})
    with monkeypatch.context() as changed:
        changed.setenv("PATH", "")
        path = fmu_of(tree, model, tmp_path, fmi=fmi)
    folder = tmp_path / "unpacked"
    zipfile.ZipFile(path).extractall(folder)
    (tmp_path / "build").mkdir()
    build.build_platform_binary(folder, tmp_path / "build")
    wanted = simulated(model, test)
    assert run(folder, drive(tree, model, test), 0.01) == pytest.approx(wanted, abs=1e-6 * np.ptp(wanted))


def test_the_same_run_gives_the_same_bytes(without_compiler, tmp_path):
    model = find_model("maxwell_damper")
    one, other = (fmu_of(run_of(model), model, tmp_path).read_bytes() for _ in range(2))
    assert one == other
    changed = fmu_of(run_of(model, {"d": 1.0}), model, tmp_path)
    tokens = [fmpy.read_model_description(str(path)).guid for path in (changed, *tmp_path.glob("model0.fmu"))]
    assert re.fullmatch(r"\{[0-9a-f-]{36}\}", tokens[0])
    assert tokens[0] != tokens[1]


def test_values_per_test_are_their_mean_or_those_of_a_test():
    model = with_effects(find_model("maxwell_damper"), find_effect("test_offset"))
    (name,) = {p.name for p in model.parameters} - {p.name for p in find_model("maxwell_damper").parameters}
    tree = run_of(model, scoped={name: [10.0, 20.0, 60.0]})
    mean, own = parameter_starts(tree, model)[name], parameter_starts(tree, model, test="test_1")[name]
    assert mean.value == 30.0
    assert "mean of 3 values, 10 to 60" in mean.origin
    assert own.value == 20.0
    assert "value of test_1" in own.origin


def test_a_condition_that_differs_needs_a_test():
    model = find_model("maxwell_tyre")
    conditions = {**{name: [value] * 2 for name, value in ROLLING.items()}, "longitudinal_velocity": [10.0, 20.0]}
    tree = run_of(model, None, conditions)
    with pytest.raises(
        InputError, match=r"'longitudinal_velocity': differs between the tests, 10 to 20 m/s\. Name .*--test"
    ):
        contents(tree, model)
    assert condition_starts(tree, model, "test_1")["longitudinal_velocity"].value == 20.0
    with pytest.raises(InputError, match=r"--test other: the run has no such test"):
        contents(tree, model, test="other")
    with pytest.raises(InputError, match=r"--mode m2: the run has no such mode"):
        contents(tree, model, "m2")
    with pytest.raises(InputError, match=r"'longitudinal_velocity': the run does not state it"):
        contents(run_of(model), model)


def test_an_unsampled_mode_gives_the_map_estimate_and_the_laplace_interval():
    model = find_model("kelvin_voigt_damper")
    tree = run_of(model, {"d": 500.0})
    tree["modes/m1"] = tree["modes/m1"].to_dataset()[["value"]].assign(laplace_sd=("parameter", [1.0, 2.0, 400.0, 4.0]))
    start = parameter_starts(tree, model)["d"]
    assert start.value == 505.0
    assert start.origin == "MAP estimate, 90 % interval 0 to 1162.96, not sampled"


class Lag(Model):
    """A state that follows the input, and one that stays zero."""

    name = "lag"
    parameters = (Parameter("T", "s", 0.01, 1.0, 0.02, "log"),)
    states = (Channel("near", "m"), Channel("idle", "m"))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations({"force": s.near}, {"near": (s.displacement - s.near) / s.T, "idle": -s.idle})


def test_sizes_of_states_are_those_of_the_tests():
    model = Lag()
    wave = 3.0 * np.sin(np.arange(2000) * 0.01)
    tree = run_of(model, tests={"drive": record(model, [wave], 0.01)})
    sizes = {v.name: v.nominal for _, v in contents(tree, model).of("local")}
    assert sizes["near"] == pytest.approx(3.0, rel=1e-3)
    assert sizes["idle"] == 1.0  # always zero: no size is known
    (own,) = (v for _, v in contents(tree, model).of("input") if v.name == "displacement")
    assert own.nominal == pytest.approx(3.0, rel=1e-4)


def test_a_simulator_of_ones_own_has_no_equations_to_write():
    with pytest.raises(InputError, match="mofit knows no equations of it to write"):
        contents(xr.DataTree(), line_simulator())
    with pytest.raises(InputError, match="Export its parameters"):
        require_equations(xr.DataTree(xr.Dataset(attrs={"model": "line", "simulations": "{}"})))
    require_equations(xr.DataTree(xr.Dataset(attrs={"model": "maxwell_damper"})))
