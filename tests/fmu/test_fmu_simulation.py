"""FMUs against exact solutions: model exchange, co-simulation, sensitivities, resets, and those that misbehave."""

import os
import pickle

import numpy as np
import pytest
from ball_fmu import ball_height, build_ball
from oscillator_fmu import build, position

from mofit.models import find_model
from mofit.models.black_box import Record
from mofit.simulation.evaluation import IsolatedExecutor, Task

TIME = np.arange(201) / 100
FORCE = 10.0 + 20.0 * TIME
RECORD = Record("ramp", TIME, {"F": FORCE}, {})
VALUES = {"k": 350.0, "d": 5.0, "m": 1.2, "x_0": 0.05}
EXACT = position(TIME, 350.0, 5.0, 1.2, 0.05, 10.0, 20.0)


@pytest.fixture(scope="module")
def executor():
    with IsolatedExecutor(timeout=20.0) as executor:
        yield executor


def run(executor, function, *values, record=RECORD, outputs=("position", "acceleration"), free=()):
    return executor.run([Task(function, record, VALUES | own, outputs, free) for own in values or ({},)])


def mapped(folder, text):
    path = folder / "map.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("version", [2, 3])
def test_model_exchange_follows_the_exact_solution(executor, tmp_path, version):
    model = find_model(str(build(tmp_path, version=version)))
    (found,) = run(executor, model.function)
    assert found.failure is None
    assert found.outputs[:, 0] == pytest.approx(EXACT, abs=2e-6)
    velocity = np.gradient(EXACT, TIME)[1:-1]
    balance = (FORCE[1:-1] - 5.0 * velocity - 350.0 * EXACT[1:-1]) / 1.2
    assert found.outputs[1:-1, 1] == pytest.approx(balance, abs=0.02)


def test_inputs_are_interpolated_where_the_fmu_can(executor, tmp_path):
    fmu = build(tmp_path, exchange=False, interpolates=True)
    (found,) = run(executor, find_model(str(fmu)).function)
    assert found.outputs[:, 0] == pytest.approx(EXACT, abs=1e-7)


@pytest.mark.parametrize("version", [2, 3])
def test_inputs_that_an_fmu_holds_are_right_to_second_order(executor, tmp_path, version):
    fmu = build(tmp_path, version=version, exchange=False)
    time = np.arange(101) / 50
    wave = np.sin(12 * time)
    record = Record("sine", time, {"F": wave}, {}, "linear")
    values = {"k": 350.0, "d": 5.0, "m": 1.2, "x_0": 0.0}
    exact = np.zeros(101)
    for begin, change in zip(time, np.diff(50 * np.diff(wave), prepend=0.0), strict=False):
        # a broken line is a sum of ramps
        exact += np.where(time >= begin, position(np.maximum(time - begin, 0), 350.0, 5.0, 1.2, slope=change), 0.0)
    errors = []
    for steps in (2, 4, 8):
        function = find_model(f"{fmu}:{mapped(tmp_path, f'steps = {steps}')}").function
        (found,) = executor.run([Task(function, record, values, ("position", "acceleration"))])
        errors.append(np.abs(found.outputs[:, 0] - exact).max() / np.abs(exact).max())
        rate = np.gradient(found.outputs[:, 0], time)
        balance = (wave - 5.0 * rate - 350.0 * found.outputs[:, 0]) / 1.2  # with the force at the sample
        assert found.outputs[2:-2, 1] == pytest.approx(balance[2:-2], abs=0.05)
    assert errors[0] < 2e-3
    assert errors[0] > 3 * errors[1] > 9 * errors[2]


@pytest.mark.parametrize("interpolation", ["linear", "hold", "cubic"])
@pytest.mark.parametrize(("version", "options"), [
    (2, {}), (3, {}), (2, {"exchange": False}), (3, {"exchange": False}), (2, {"exchange": False, "interpolates": True})
])  # fmt: skip
def test_inputs_run_between_samples_as_the_record_says(executor, tmp_path, version, options, interpolation):
    function = find_model(str(build(tmp_path, version=version, **options))).function
    time, many = np.arange(61) / 30, 40
    levels = np.cumsum(np.random.default_rng(0).normal(size=61)) if interpolation == "hold" else np.sin(9 * time)
    record = Record("drive", time, {"F": levels}, {}, interpolation)
    values = {"k": 350.0, "d": 5.0, "m": 1.2, "x_0": 0.0}
    (found,) = executor.run([Task(function, record, values, ("position", "acceleration"))])
    # any curve is nearly a sum of short ramps, and one that is held is a sum of steps
    fine = np.arange(60 * many + 1) / (30 * many)
    curve, exact = {"hold": levels, "linear": np.interp(fine, time, levels), "cubic": np.sin(9 * fine)}, np.zeros(61)
    if interpolation == "hold":
        for begin, change in zip(time, np.diff(levels, prepend=0.0), strict=True):
            exact += np.where(time >= begin, position(time - begin, 350.0, 5.0, 1.2, force=change), 0.0)
    else:
        rates = np.diff(curve[interpolation]) * 30 * many
        for begin, change in zip(fine, np.diff(rates, prepend=0.0), strict=False):
            exact += np.where(time >= begin, position(np.maximum(time - begin, 0), 350.0, 5.0, 1.2, slope=change), 0.0)
    # a step later or earlier by one sample would be wrong by a tenth; linear beside cubic by a hundredth
    size = np.abs(exact).max()
    assert found.outputs[:, 0] == pytest.approx(exact, abs=1.5e-3 * size)
    rate = (levels - 350.0 * exact) / 1.2  # less the damper's part
    damped = np.abs(found.outputs[:, 1] - rate).max()
    assert damped < 5.0 / 1.2 * 1.1 * np.abs(np.gradient(exact, time)).max() + 0.01


def test_by_default_held_inputs_change_ten_times_per_sample(tmp_path):
    assert find_model(str(build(tmp_path, exchange=False))).function.mapping.steps == 10
    assert find_model(str(build(tmp_path, exchange=False, interpolates=True))).function.mapping.steps == 4


def in_steps_of(size):
    """A change of the description: the FMU takes no other communication step."""
    variable = 'canHandleVariableCommunicationStepSize="true"'
    return lambda text: text.replace(variable, f'fixedInternalStepSize="{size}"')


def test_an_fmu_of_a_fixed_step_gets_that(executor, tmp_path):
    fixed = find_model(str(build(tmp_path, version=3, exchange=False, change=in_steps_of(0.0025)))).function
    early = position(TIME, 350.0, 5.0, 1.2, 0.05, 10.0 + 20.0 * 0.00125, 20.0)  # by half a step
    assert run(executor, fixed)[0].outputs[:, 0] == pytest.approx(early, abs=2e-5)
    (odd,) = run(
        executor, find_model(str(build(tmp_path, version=3, exchange=False, change=in_steps_of(0.003)))).function
    )
    assert odd.failure == "the sampling interval 0.01 s is no multiple of the FMU's fixed step 0.003 s"


@pytest.mark.parametrize("restitution", [0.9, 0.75])
def test_events_of_model_exchange_are_handled(executor, tmp_path, restitution):
    model = find_model(str(build_ball(tmp_path)))
    assert not hasattr(model.function, "sensitivities")
    time = np.arange(151) / 100
    record = Record("drop", time, {}, {})
    values = {"g": 9.0, "e": restitution}
    (found,) = executor.run([Task(model.function, record, values, ("height",))])
    assert found.outputs[:, 0] == pytest.approx(ball_height(time, **values), abs=1e-5)


def exact_slopes():
    columns = []
    for name, value in VALUES.items():
        ends = [position(TIME, **{**VALUES, name: value + side * 1e-4}, force=10.0, slope=20.0) for side in (1, -1)]
        columns.append((ends[0] - ends[1]) / 2e-4)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(("flaw", "version"), [((), 2), ((), 3), (("WITHOUT_PARAMETERS",), 2)])
def test_sensitivities_are_exact_with_directional_derivatives_and_without(executor, tmp_path, flaw, version):
    model = find_model(str(build(tmp_path, *flaw, version=version)))
    (found,) = run(executor, model.function, free=tuple(VALUES))
    for k, exact in enumerate(exact_slopes().T):
        assert found.slopes[:, 0, k] == pytest.approx(exact, abs=1e-3 * np.abs(exact).max())
    assert found.outputs[:, 0] == pytest.approx(EXACT, abs=2e-6)


def test_co_simulation_offers_no_sensitivities(tmp_path):
    assert hasattr(find_model(str(build(tmp_path))).function, "sensitivities")
    path = mapped(tmp_path, "interface = 'co-simulation'")
    assert not hasattr(find_model(f"{build(tmp_path)}:{path}").function, "sensitivities")


@pytest.mark.parametrize("exchange", [True, False])
@pytest.mark.parametrize("flaw", [(), ("FORGETFUL",)], ids=["sound", "forgetful"])
def test_an_answer_does_not_depend_on_earlier_ones(executor, tmp_path, exchange, flaw):
    function = find_model(str(build(tmp_path, *flaw, exchange=exchange))).function
    answers = run(executor, function, {}, {"k": 100.0, "x_0": 0.3}, {}, {"d": 50.0}, {})
    for one in answers[2], answers[4]:
        np.testing.assert_array_equal(one.outputs, answers[0].outputs)
    assert answers[0].outputs[:, 0] == pytest.approx(EXACT, abs=1e-3)


def test_a_hostile_fmu_costs_the_evaluations_it_spoils(tmp_path):
    function = find_model(str(build(tmp_path, exchange=False))).function
    with IsolatedExecutor(jobs=2, timeout=2.0) as executor:
        found = run(executor, function, {"k": 350.0}, {"k": 666.0}, {"k": 667.0}, {"k": 668.0}, {"k": 350.0})
    told = [one.failure for one in found]
    assert told == [None, "crashed (signal 11)", "no answer within 2 s", "nan at 0.31 s", None]
    np.testing.assert_array_equal(found[0].outputs, found[4].outputs)


def test_a_call_here_runs_in_another_process(tmp_path):
    trap = tmp_path / "loaded"
    code = "#include <stdio.h>\n#include <unistd.h>\n__attribute__((constructor)) static void load(void)"
    writes = f'{{ FILE *f = fopen("{trap}", "w"); fprintf(f, "%d", getpid()); fclose(f); }}'
    function = find_model(str(build(tmp_path, extra=f"{code} {writes}\n"))).function
    assert function(RECORD, VALUES)["position"] == pytest.approx(EXACT, abs=2e-6)
    assert int(trap.read_text()) != os.getpid()
    with pytest.raises(RuntimeError, match=r"the FMU failed: crashed \(signal 11\)"):
        function(RECORD, {**VALUES, "k": 666.0})
    outputs, slopes = function.sensitivities(RECORD, VALUES, ("k",))
    assert outputs[:, 0] == pytest.approx(EXACT, abs=2e-6)
    assert slopes[:, 0, 0] == pytest.approx(exact_slopes()[:, 0], abs=1e-6)


def test_units_of_the_fmu_become_si(executor, tmp_path):
    def in_other_units(text):
        text = text.replace('unit="N/m" start="400"', 'unit="N/mm" start="0.4"').replace(
            '"kg" start="1"', '"lump" start="1"'
        )
        return text.replace('<Real unit="m" start="0"/>', '<Real unit="mm" start="0"/>')

    model = find_model(str(build(tmp_path, change=in_other_units)))
    k, _, m, _ = model.parameters
    assert (k.unit, k.nominal, k.lower, k.upper) == ("N/m", pytest.approx(400), pytest.approx(40), pytest.approx(4000))
    assert (m.unit, m.nominal, m.limits) == ("kg", 0.5, (0.25, 1.0))
    # the code knows nothing of the units that the description claims: k = 350e3 N/m is 350 of them
    (found,) = run(executor, model.function, {"k": 350e3, "m": 0.6})
    assert found.outputs[:, 0] == pytest.approx(1e-3 * EXACT, abs=2e-9)


def test_a_function_pickles_without_its_instance(executor, tmp_path):
    function = find_model(str(build(tmp_path))).function
    again = pickle.loads(pickle.dumps(function))
    assert again.fingerprint == function.fingerprint
    one, other = (run(executor, own)[0].outputs for own in (function, again))
    np.testing.assert_array_equal(one, other)


def test_the_fingerprint_changes_with_file_and_map(tmp_path):
    fmu = build(tmp_path)
    before = find_model(str(fmu)).fingerprint
    assert find_model(f"{fmu}:{mapped(tmp_path, 'tolerance = 1e-9')}").fingerprint != before
    build(tmp_path, "FORGETFUL")
    assert find_model(str(fmu)).fingerprint != before
