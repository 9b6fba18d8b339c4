import ctypes
import json
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest
import xarray as xr

from mofit.errors import InputError
from mofit.models import build_system, with_effects
from mofit.models.registry import effect_names, find_effect, find_model, model_names
from mofit.results.export import c_source, identified_function, model_of_run
from mofit.simulation import ExperimentData, Simulator

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")
ORIGIN = {"title": "a test */ with a trap", "solution": "m1"}


def run_of(model, fixed=None):
    """As much of a run as the functions read: the nominal parameters were found."""
    held = fixed or {}
    free = [p for p in model.parameters if p.name not in held]
    configuration = {"equations": build_system(model).hash(), "fixed": held}
    cluster = xr.Dataset(
        {"value": ("parameter", [p.nominal for p in free])}, {"parameter": ("parameter", [p.name for p in free])}
    )
    root = xr.Dataset(attrs={"model": model.name, "configuration": json.dumps(configuration)})
    return xr.DataTree.from_dict({"/": root, "/modes/m1": cluster})


def compiled(folder, text, name):
    """The plain face of the C source, as a function of three arrays."""
    (folder / "model.c").write_text(text)
    command = [COMPILER, "-std=c99", "-Wall", "-Werror", "-O2", "-fPIC", "-shared", "model.c", "-o", "model.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    face = getattr(ctypes.CDLL(str(folder / "model.so")), name)
    face.argtypes = [ctypes.c_void_p] * 6

    def call(x, u, c, sizes):
        given = [np.ascontiguousarray(values, dtype=float) for values in (x, u, c)]
        found = [np.full(size, np.nan) for size in sizes]
        assert face(*(a.ctypes.data for a in (*given, *found))) == 0
        return found

    return call


def values_of(model, rng):
    """States, inputs and conditions of a plausible size."""
    x = 1e-3 * rng.normal(size=len(model.states))
    u = 1e-2 * rng.normal(size=len(model.inputs))
    c = np.array([16.0 if item.default is None else item.default for item in model.conditions])
    return x, u, c


@pytest.mark.parametrize("name", model_names())
def test_the_function_is_the_model_with_its_parameters_in_it(name):
    model = find_model(name)
    system = build_system(model)
    function = identified_function(run_of(model), model)
    x, u, c = values_of(model, np.random.default_rng(0))
    p = [parameter.nominal for parameter in model.parameters]
    for found, wanted in zip(
        function(x, u, c), (system.rhs(x, u, p, c), system.out(x, u, p, c), system.initial(u, p, c)), strict=True
    ):
        np.testing.assert_array_equal(found.full(), wanted.full())


@needs_compiler
@pytest.mark.parametrize("name", ["maxwell_tyre", "bouc_wen_damper", "maxwell_tyre+dry_friction", "tmeasy_curve"])
def test_compiled_c_agrees_with_casadi(name, tmp_path):
    base, *effects = name.split("+")
    model = with_effects(find_model(base), *(find_effect(effect) for effect in effects))
    function = identified_function(run_of(model), model)
    call = compiled(tmp_path, c_source(function, model, ORIGIN), function.name())
    rng = np.random.default_rng(1)
    for _ in range(20):
        x, u, c = values_of(model, rng)
        wanted = [np.ravel(value.full()) for value in function(x, u, c)]
        for found, value in zip(call(x, u, c, [len(v) for v in wanted]), wanted, strict=True):
            np.testing.assert_allclose(found, value, rtol=1e-13, atol=1e-300)


@needs_compiler
def test_a_simulation_with_the_c_function_gives_the_outputs_of_the_kernel(tmp_path):
    model = find_model("maxwell_tyre")
    system = build_system(model)
    conditions = np.array([60 / 3.6, 1.0, 0.01])
    step, steps = 0.01, 20
    angle = np.deg2rad(2) * np.sin(2 * np.pi * 2 * np.arange(100) * step)[:, None]
    experiment = ExperimentData("sine", step, angle, "cubic", conditions, np.zeros((100, 1)), np.ones((100, 1)))
    p = [parameter.nominal for parameter in model.parameters]
    wanted = Simulator(system, [experiment], tolerance=1e-9).simulate([p])[0][0, :, 0]
    function = identified_function(run_of(model), model)
    call = compiled(tmp_path, c_source(function, model, ORIGIN), function.name())

    def evaluate(t, x):
        return call(x, experiment.at(np.array([t]))[:, 0], conditions, (2, 1, 2))

    h = step / steps
    x, found = evaluate(0.0, np.zeros(2))[2], []
    for k in range(100 * steps):
        t = k * h
        k1, y, _ = evaluate(t, x)
        if k % steps == 0:
            found.append(y[0])
        k2 = evaluate(t + h / 2, x + h / 2 * k1)[0]
        k3 = evaluate(t + h / 2, x + h / 2 * k2)[0]
        k4 = evaluate(t + h, x + h * k3)[0]
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    np.testing.assert_allclose(found, wanted, atol=1e-7 * np.ptp(wanted))


def test_the_comment_names_inputs_units_and_order():
    model = find_model("maxwell_tyre")
    text = c_source(identified_function(run_of(model), model), model, ORIGIN)
    comment = text[: text.index("*/")]
    assert "[1] branch_displacement [m]" in comment
    assert "[0] slip_angle [rad]" in comment
    assert "[0] longitudinal_velocity [m/s]" in comment
    assert "[2] fictitious_velocity [m/s]" in comment
    assert "usually 0.01" in comment
    assert "a test * / with a trap" in comment


def test_held_parameters_go_in_with_their_values():
    model = find_model("maxwell_damper")
    name = model.parameters[0].name
    plain, other = (
        identified_function(run_of(model, fixed), model) for fixed in (None, {name: 2 * model.parameters[0].nominal})
    )
    x, u, c = values_of(model, np.random.default_rng(2))
    assert float(plain(x, u, c)[1]) != float(other(x, u, c)[1])


def test_a_saved_function_loads_without_mofit(tmp_path):
    model = find_model("maxwell_tyre")
    function = identified_function(run_of(model), model)
    function.save(str(tmp_path / "tyre.casadi"))
    loaded = ca.Function.load(str(tmp_path / "tyre.casadi"))
    x, u, c = values_of(model, np.random.default_rng(3))
    assert (loaded.name_in(), loaded.name_out()) == (["x", "u", "c"], ["xdot", "y", "x0"])
    np.testing.assert_array_equal(loaded(x, u, c)[0].full(), function(x, u, c)[0].full())


def test_the_model_of_a_run_is_found_with_its_effects_and_must_be_the_same():
    assert "dry_friction" in effect_names()
    model = with_effects(find_model("maxwell_tyre"), find_effect("dry_friction"))
    tree = run_of(model)
    assert model_of_run(tree).name == model.name
    with pytest.raises(InputError, match="not those that the run identified"):
        model_of_run(tree, "kelvin_voigt_tyre")
    with pytest.raises(InputError, match=r"no such mode. Known are: m1"):
        identified_function(tree, model, "m2")
    with pytest.raises(InputError, match="parameter 'd_M': the run has no value for it"):
        identified_function(run_of(find_model("kelvin_voigt_tyre")), find_model("maxwell_tyre"))
