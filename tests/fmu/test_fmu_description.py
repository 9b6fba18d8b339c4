"""The model that an FMU declares: its parameters, channels and ranges, its map, and what is refused."""

import subprocess
import sys
import zipfile

import numpy as np
import pytest
from oscillator_fmu import build

from mofit.errors import InputError
from mofit.models import find_model
from mofit.models.fmu.units import si_conversion


def mapped(folder, text):
    path = folder / "map.toml"
    path.write_text(text)
    return path


def parameters(model):
    return {one.name: one for one in model.parameters}


@pytest.fixture
def fmu(tmp_path):
    return build(tmp_path)


def test_the_model_is_what_the_description_declares(fmu):
    model = find_model(str(fmu))
    assert model.name == "oscillator"
    assert [(one.name, one.unit, one.description) for one in model.inputs] == [("F", "N", "force")]
    assert [(one.name, one.unit) for one in model.outputs] == [("position", "m"), ("acceleration", "m/s^2")]
    found = parameters(model)
    assert list(found) == ["k", "d", "m", "x_0"]
    k, d, m, x_0 = found.values()
    assert (k.unit, k.lower, k.upper, k.nominal, k.scale, k.description) == ("N/m", 40, 4000, 400, "log", "stiffness")
    assert k.limits == (0.0, float("inf"))
    assert (d.unit, d.lower, d.upper, d.scale) == ("N s/m", 0.4, 40, "log")
    assert (m.lower, m.upper, m.limits) == (0.5, 2, (0.5, 2))
    assert (x_0.lower, x_0.upper, x_0.nominal, x_0.scale) == (-0.5, 0.5, 0.0, "linear")


def test_free_parameters_are_named_in_the_reference(fmu):
    assert list(parameters(find_model(f"{fmu}::d, k"))) == ["d", "k"]


def test_a_map_renames_chooses_and_fixes(fmu, tmp_path):
    path = mapped(
        tmp_path,
        """
        tolerance = 1e-7
        inputs.force = "F"
        outputs.speed = "velocity"
        conditions.mass = "m"
        parameters.stiffness = { variable = "k", lower = 100, upper = 900, scale = "linear" }
        values.d = 3.0
        """,
    )
    model = find_model(f"{fmu}:{path}")
    assert [one.name for one in model.inputs] == ["force"]
    assert [(one.name, one.unit) for one in model.outputs] == [("speed", "m/s")]
    assert [(one.name, one.unit, one.default) for one in model.conditions] == [("mass", "kg", 1.0)]
    (stiffness,) = model.parameters
    assert (stiffness.name, stiffness.lower, stiffness.upper, stiffness.scale) == ("stiffness", 100, 900, "linear")
    assert model.function.mapping.tolerance == 1e-7
    assert list(parameters(find_model(f"{fmu}:{path}:x_0,stiffness"))) == ["x_0", "stiffness"]


def test_every_wrong_name_of_a_map_is_told_at_once(fmu, tmp_path):
    path = mapped(
        tmp_path,
        """
        inputs.force = "f"
        outputs.position = "k"
        conditions.load = { variable = "m", unit = "lump" }
        parameters.stiffness = "kk"
        values.damping = 1.0
        """,
    )
    with pytest.raises(InputError) as caught:
        find_model(f"{fmu}:{path}")
    assert [str(issue) for issue in caught.value.issues] == [
        "FMU 'oscillator.fmu': 'force' is to be its variable 'f', which it lacks. Did you mean 'F'?",
        "FMU 'oscillator.fmu': 'position' is to be its parameter variable 'k', not a output or local or "
        "calculatedParameter. Known are: acceleration, der(position), position, velocity.",
        "FMU 'oscillator.fmu': 'stiffness' is to be its variable 'kk', which it lacks. Did you mean 'k'?",
        "FMU 'oscillator.fmu': unit 'lump' of 'load' is unknown. Write an SI unit, such as 'N s/m'.",
        "FMU 'oscillator.fmu': 'damping' is to be its variable 'damping', which it lacks. Known are: d, k, m, x_0.",
    ]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[input]\nforce = 'F'", r"map 'map\.toml', input: unknown key\. Did you mean 'inputs'"),
        ("steps = 0", "steps: Input should be greater than or equal to 1"),
        ("interface = 'both'", "interface: Input should be 'model exchange' or 'co-simulation'"),
        ("[outputs]", r"declares no real output\. Name one in the map"),
    ],
)
def test_a_wrong_map_is_told(fmu, tmp_path, text, told):
    with pytest.raises(InputError, match=told):
        find_model(f"{fmu}:{mapped(tmp_path, text)}")


def test_what_is_free_must_exist(fmu):
    with pytest.raises(InputError, match=r"has no parameter 'stiffness'\. Known are: d, k, m, x_0"):
        find_model(f"{fmu}::stiffness")


def test_a_range_is_needed_where_nothing_tells_one(tmp_path):
    fmu = build(tmp_path, change=lambda text: text.replace('start="4"', 'start="0"'))
    with pytest.raises(InputError, match=r"parameter 'd' starts at 0 and has no range.*lower = …, upper = …"):
        find_model(str(fmu))
    assert list(parameters(find_model(f"{fmu}::k"))) == ["k"]
    path = mapped(tmp_path, "parameters.d = { variable = 'd', lower = 0, upper = 9 }")
    (d,) = find_model(f"{fmu}:{path}").parameters
    assert (d.lower, d.upper, d.scale) == (0, 9, "linear")


def test_of_many_parameters_those_to_identify_are_to_be_named(tmp_path):
    more = "".join(
        f'<ScalarVariable name="p{k}" valueReference="{k}" causality="parameter" variability="fixed">'
        f'<Real start="1"/></ScalarVariable>'
        for k in range(20)
    )
    fmu = build(tmp_path, change=lambda text: text.replace("</ModelVariables>", more + "</ModelVariables>"))
    with pytest.raises(InputError, match=r"has 24 parameters: k, d, m, x_0, p0.*as --free k,d"):
        find_model(str(fmu))
    assert list(parameters(find_model(f"{fmu}::k,p3"))) == ["k", "p3"]


def test_an_unknown_unit_is_asked_for(tmp_path):
    fmu = build(tmp_path, change=lambda text: text.replace('unit="N.s/m"', 'unit="frob"'))
    with pytest.raises(InputError, match=r"unit 'frob' of 'd' is unknown\. Give its unit in the map"):
        find_model(str(fmu))
    path = mapped(tmp_path, "parameters.d = { variable = 'd', unit = 'kN s/m' }")
    (d,) = find_model(f"{fmu}:{path}").parameters
    assert (d.unit, d.nominal) == ("N s/m", 4000)


@pytest.mark.parametrize(
    ("spelt", "unit", "factor", "offset"),
    [
        ("N.m/rad", "N m/rad", 1.0, 0.0),
        ("kg.m2", "kg m^2", 1.0, 0.0),
        ("m/s2", "m/s^2", 1.0, 0.0),
        ("degC", "K", 1.0, 273.15),
        ("rev/min", "rad/s", np.pi / 30, 0.0),
        ("kN.s/mm", "N s/m", 1e6, 0.0),
        ("l/min", "m^3/s", 1e-3 / 60, 0.0),
        ("1", "1", 1.0, 0.0),
    ],
)
def test_units_are_read_as_modelica_spells_them(spelt, unit, factor, offset):
    found = si_conversion(spelt)
    assert (found.unit, found.factor, found.offset) == (unit, pytest.approx(factor), pytest.approx(offset))


def refused(path, told):
    with pytest.raises(InputError, match=told):
        find_model(str(path))


def test_files_that_are_no_usable_fmus_are_refused(fmu, tmp_path):
    refused(tmp_path / "absent.fmu", "no such file")
    damaged = tmp_path / "damaged.fmu"
    damaged.write_bytes(fmu.read_bytes()[:2000])
    refused(damaged, "not a readable FMU")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    refused(tmp_path / "empty.fmu", "not a readable FMU")
    refused(
        build(tmp_path, change=lambda text: text.replace('fmiVersion="2.0"', 'fmiVersion="1.0"')),
        r"is of FMI 1\.0\. Export it as",
    )
    with zipfile.ZipFile(tmp_path / "windows.fmu", "w") as archive, zipfile.ZipFile(build(tmp_path)) as other:
        archive.writestr("modelDescription.xml", other.read("modelDescription.xml"))
        archive.writestr("binaries/win64/oscillator.dll", b"")
    refused(tmp_path / "windows.fmu", "has binaries for win64, not for linux64.*fmpy compile")


def test_without_fmpy_the_extra_is_named(fmu):
    # None in sys.modules is how Python says that a package is absent
    script = (
        "import sys; sys.modules['fmpy'] = None\n"
        "from mofit.cli import main\n"
        f"sys.exit(main(['identify', '--model', {str(fmu)!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=fmu.parent)
    assert done.returncode == 2
    assert "pip install 'mofit[fmu]'" in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


def test_no_code_of_an_fmu_runs_before_it_is_simulated(tmp_path):
    trap = tmp_path / "loaded"
    source = f'__attribute__((constructor)) static void load(void) {{ fclose(fopen("{trap}", "w")); }}'
    fmu = build(tmp_path, extra=f"#include <stdio.h>\n{source}\n")
    find_model(str(fmu))
    assert not trap.exists()
