"""What an importer may do with an FMU: inputs of every kind, states kept, and what is refused."""

import numpy as np
import pytest
from fmu_runs import (
    ROLLING,
    Master,
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
)

from mofit.models import Channel, Equations, Model, find_model
from mofit.parameters import Parameter


@pytest.fixture(scope="module")
def damper(tmp_path_factory):
    """A damper's model, test, run and FMU of version 3."""
    model = find_model("maxwell_damper")
    test = record(model, stroke(), 0.002)
    tree = run_of(model, tests={"drive": test})
    return model, test, tree, fmu_of(tree, model, tmp_path_factory.mktemp("damper"))


@pytest.fixture(scope="module")
def tyre(tmp_path_factory):
    """The same of a tyre in both versions."""
    model, folder = find_model("maxwell_tyre"), tmp_path_factory.mktemp("tyre")
    test = record(model, steer(), 0.01, list(ROLLING.values()))
    tree = run_of(model, None, {name: [value] for name, value in ROLLING.items()}, {"drive": test})
    return model, test, tree, {fmi: fmu_of(tree, model, folder, fmi=fmi) for fmi in ("2", "3")}


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_an_input_without_derivatives_is_held(tyre, fmi):
    model, test, _, paths = tyre
    held = record(model, steer(), 0.01, list(ROLLING.values()), "hold")
    wanted, found = simulated(model, held), []
    master = Master(paths[fmi]).initialise(slip_angle=held.inputs[0, 0])
    for angle in held.inputs[:, 0]:
        master.set(slip_angle=angle)
        found.append(master.get("lateral_force"))
        master.step(0.01)
    assert found == pytest.approx(wanted, abs=1e-6 * np.ptp(wanted))
    assert np.max(np.abs(wanted - simulated(model, test))) > 0.01 * np.ptp(wanted)  # another than the smooth one


@needs_compiler
def test_the_first_derivative_of_fmi_2_makes_inputs_linear(tyre):
    model, _, _, paths = tyre
    linear = record(model, steer(), 0.01, list(ROLLING.values()), "linear")
    wanted = simulated(model, linear)
    signals = np.zeros(linear.samples, dtype=[("time", float), ("slip_angle", float)])
    signals["time"], signals["slip_angle"] = 0.01 * np.arange(linear.samples), linear.inputs[:, 0]
    master, found = Master(paths["2"]).initialise(), []
    for k, angle in enumerate(signals["slip_angle"]):
        reference, slope = master.references["slip_angle"], np.append(np.diff(signals["slip_angle"]), 0) / 0.01
        master.set(slip_angle=angle)
        master.fmu.setRealInputDerivatives([reference], [1], [slope[k]])
        found.append(master.get("lateral_force"))
        master.step(0.01)
    assert found == pytest.approx(wanted, abs=1e-6 * np.ptp(wanted))
    assert master.get("der(slip_angle)") == 0


@needs_compiler
def test_a_velocity_that_is_not_connected_is_estimated(damper):
    model, _, _, path = damper
    errors = []
    for parts in (1, 2, 4):
        step = 0.002 / parts
        fine = record(model, stroke(step, 800 * parts), step)
        signals = np.zeros(fine.samples, dtype=[("time", float), ("displacement", float), ("velocity", float)])
        signals["time"], signals["displacement"] = step * np.arange(fine.samples), fine.inputs[:, 0]
        wanted = simulated(model, fine)
        errors.append(np.max(np.abs(run(path, signals, step) - wanted)[50 * parts :]) / np.ptp(wanted))
    # a column of zeros is what an importer sets for a plug that is open
    assert errors[2] < 0.01
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.2)
    assert errors[1] / errors[2] == pytest.approx(2, abs=0.2)


@needs_compiler
def test_parameters_and_conditions_can_be_set(tyre):
    model, _, tree, paths = tyre
    changed = {"c_M": 3e4, "d_y": 100.0}
    other = record(model, steer(), 0.01, [20.0, 1.0, 0.01])
    found = run(paths["3"], drive(tree, model, other), 0.01, start_values={**changed, "longitudinal_velocity": 20.0})
    wanted = simulated(model, other, changed)
    assert found == pytest.approx(wanted, abs=1e-6 * np.ptp(wanted))


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_state_that_is_kept_is_taken_up_again(tyre, fmi):
    master = Master(tyre[3][fmi]).initialise(slip_angle=0.02)
    master.step(0.03)
    fmu, kept = master.fmu, master.time
    if fmi == "3":
        restored = fmu.deserializeFMUState(fmu.serializeFMUState(fmu.getFMUState()))
    else:
        restored = fmu.deSerializeFMUstate(fmu.serializeFMUstate(fmu.getFMUstate()))
    master.set(slip_angle=0.05)
    master.step(0.05)
    first = master.get("lateral_force")
    (fmu.setFMUState if fmi == "3" else fmu.setFMUstate)(restored)
    assert master.get("lateral_force") != first
    master.time = kept
    master.set(slip_angle=0.05)
    master.step(0.05)
    assert master.get("lateral_force") == first


class BlowUp(Model):
    """Grows beyond all bounds in the time T: y = 1 / (1 - t / T)."""

    name = "blow_up"
    parameters = (Parameter("T", "s", 0.1, 10.0, 1.0),)
    states = (Channel("y", "m"),)
    inputs = (Channel("force", "N"),)
    outputs = (Channel("displacement", "m"),)

    def equations(self, s):
        return Equations({"displacement": s.y + s.force}, {"y": s.y**2 / s.T}, {"y": 1.0 + 0 * s.T})


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_what_cannot_be_done_is_refused_and_changes_nothing(fmi, tmp_path):
    master = Master(fmu_of(run_of(BlowUp()), BlowUp(), tmp_path, fmi=fmi))
    error = fmpy.fmi1.FMICallException
    with pytest.raises(error):
        master.step(0.5)  # before initialization
    master.initialise(force=0.0)
    for value in (np.nan, np.inf):
        with pytest.raises(error):
            master.set(force=value)
    with pytest.raises(error):
        master.set(displacement=1.0)
    with pytest.raises(error):
        master.step(0.0)
    with pytest.raises(error):
        master.fmu.doStep(currentCommunicationPoint=5.0, communicationStepSize=0.01)
    with pytest.raises(error):
        master.step(1.5)  # beyond the pole
    assert master.get("displacement") == 1.0
    master.step(0.5)
    assert master.get("displacement") == pytest.approx(2.0, rel=1e-6)


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_an_fmu_can_be_reset_and_many_run_side_by_side(tyre, fmi):
    one, other = (Master(tyre[3][fmi]) for _ in range(2))
    one.initialise(slip_angle=0.02)
    other.initialise(slip_angle=0.04)
    begin = one.get("lateral_force")
    for master in (one, other):
        master.set(slip_angle=0.05)
        master.step(0.01)
    assert one.get("lateral_force") != other.get("lateral_force")
    one.fmu.reset()
    one.time = 0.0
    assert one.initialise(slip_angle=0.02).get("lateral_force") == begin


@needs_compiler
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_another_fmu_is_not_started(tyre, fmi):
    path = tyre[3][fmi]
    description = fmpy.read_model_description(str(path))
    description.guid = "{another}"
    with pytest.raises(Exception, match="instantiate"):
        fmpy.instantiate_fmu(fmpy.extract(str(path)), description, "CoSimulation")
