"""Generated campaigns as the package sees them: without a hidden effect its model is right."""

import numpy as np
import pytest
from append import append_test
from causes import LIBRARY
from generate import make
from hidden import Slot, label, setting
from respond import Case, respond
from rig_tests import FREQUENCIES, FURTHER
from specimen import NOISES

from mofit.data import check_campaign, read_campaign
from mofit.diagnosis.candidates import choose_effects
from mofit.diagnosis.integration import SimulatorCache
from mofit.identification.calibration import calibrated_values
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.models import find_model, with_effects
from mofit.optimize import merge, refine
from mofit.simulation import experiment_data

#: causes that are compared in every run of the tests; the others in the long ones
QUICK = ("quadratic_damping", "contact_patch_lag")


def made(tmp_path, slot):
    make([slot], {}, tmp_path)
    return tmp_path / f"{slot.campaign}.nc"


@pytest.mark.parametrize("number", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))], ids=NOISES)
def test_without_effect_the_model_is_right(tmp_path, number):
    slot = Slot(31, "none", "", number)
    path = made(tmp_path, slot)
    campaign, model, settings = read_campaign(path), find_model("maxwell_tyre"), Settings()
    setup = set_up_problem(model, campaign, settings)
    assert setup.warnings == ()
    selected, problem = setup.campaign, setup.posterior.main
    known = calibrated_values(setup.calibrations)
    start = problem.space.to_unit([known.get(p.name, p.nominal) for p in problem.space.parameters])
    (best, *_) = merge(refine(problem.evaluate, start[None]))
    specimen, tests = setting(slot)
    sines = [test for test in tests if test.kind == "sine"]
    true = respond([(Case(specimen), test) for test in sines])
    at_truth, at_fit = (
        problem.simulator.sensitivities(problem.layout.full(u[None]))
        for u in (problem.space.to_unit([specimen[name] for name in problem.space.names]), best.point)
    )
    for test, force in zip(sines, true, strict=True):
        index, settled = problem.tests.index(test.name), round(test.rate / test.frequency)
        here, fitted = (out[index][0][0, :, 0] for out in (at_truth, at_fit))
        # two integrators of the same equations, far below the 0.3 to 1 N to which noise lets a line be known
        assert np.sqrt(np.mean((here - force)[settled:] ** 2)) < (0.06 if test.amplitude < 0.1 else 0.15)
        measured = selected.select((test.name,)).measurements[0].outputs["lateral_force"]
        noise, left = (np.sqrt(np.mean((measured - x)[settled:] ** 2)) for x in (force, fitted))
        assert left == pytest.approx(noise, rel=0.03)
    for name, value in zip(problem.space.names, problem.space.from_unit(best.point), strict=True):
        assert value == pytest.approx(specimen[name], rel=0.25 if name == "d_y" else 0.12)


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """Specimen, tests, campaign and problem of a campaign without effect."""
    slot, model, settings = Slot(31, "none", "", 0), find_model("maxwell_tyre"), Settings()
    specimen, tests = setting(slot)
    campaign = read_campaign(made(tmp_path_factory.mktemp("bare"), slot))
    setup = set_up_problem(model, campaign, settings, [test.name for test in tests if test.kind == "sine"])
    return specimen, {test.name: test for test in tests}, setup.campaign, setup.posterior.main


@pytest.mark.parametrize(
    "cause",
    [pytest.param(cause, marks=() if cause.name in QUICK else pytest.mark.slow) for cause in LIBRARY],
    ids=lambda cause: cause.name,
)
def test_an_effect_is_what_the_library_takes_it_for(bare, cause):
    """At the truth both simulate the same record: what is left of an effect that is named is not the generator's."""
    specimen, tests, campaign, problem = bare
    shape = {name: (low * high) ** 0.5 for name, (low, high) in cause.shape.items()}
    true = {**specimen, **cause.typical, **shape}
    (effect,) = (one for one in choose_effects(problem.model, campaign)[0] if one.name == cause.name)
    model = with_effects(problem.model, effect)
    free = [parameter.name for parameter in model.parameters if parameter.name in true]
    assert set(cause.typical) <= set(free)
    experiments = [
        experiment_data(model, *one, settled=False) for one in zip(problem.measurements, problem.signals, strict=True)
    ]
    _, simulator = SimulatorCache().simulator(model, experiments, free, 16)
    outputs = simulator.sensitivities(np.array([[true[name] for name in free]]))
    case = Case(specimen, {**cause.typical, **shape})
    for name, allowed in (
        ("sine_1_00Hz", 0.5),
        ("sine_2_50Hz", 0.5),
        ("sine_4_00Hz", 0.5),
        ("sine_6_00Hz_8deg_36kmh", 1.2),
        # a tenth of the noise: the fourth difference of 20 samples per period is inertia's
        ("sine_16_00Hz_2deg_90kmh", 2.0),
        ("sine_20_00Hz_2deg_90kmh", 2.0),
    ):
        (force,), test = respond([(case, tests[name])]), tests[name]
        here = outputs[problem.tests.index(name)][0][0, :, 0]
        assert np.sqrt(np.mean((here - force)[round(test.rate / test.frequency) :] ** 2)) < allowed


def test_files_have_no_faults_and_say_what_an_effect_needs(tmp_path):
    path = made(tmp_path, Slot(31, "none", "", 0))
    campaign = read_campaign(path)
    assert [issue for issue in check_campaign(path) if issue.severity == "error"] == []
    sines = [m.experiment for m in campaign.measurements if m.kind == "sine"]
    assert len(sines) == len({(p.frequency, p.amplitude, *p.conditions.items()) for p in sines})
    assert len(sines) == len((*FREQUENCIES, *FURTHER))
    for procedure in sines:
        assert procedure.start_time is not None
        assert {"wheel_phase", "drum_phase", "drum_radius", "dynamic_rolling_radius"} <= set(procedure.conditions)


def test_the_advised_test_is_run_on_the_same_tyre(tmp_path):
    slot = Slot(31, "none", "", 0)
    path = made(tmp_path, slot)
    entry = label(slot)
    spec = {"kind": "sine", "frequency": 6.0, "amplitude": 0.02, "duration": 10.0, "separation": 50.0,
            "rate": 200.0, "conditions": {"longitudinal_velocity": 5.56}}  # fmt: skip
    append_test(path, entry, spec, tmp_path / "next.nc")
    before, after = read_campaign(path), read_campaign(tmp_path / "next.nc")
    assert [m.name for m in after.measurements][:-1] == [m.name for m in before.measurements]
    added = after.measurements[-1]
    assert (added.name, added.kind, added.experiment.frequency) == ("sine_next", "sine", 6.0)
    assert added.experiment.conditions["longitudinal_velocity"] == 5.56
    assert added.experiment.step == pytest.approx(1 / 200)
    assert added.experiment.start_time > max(m.experiment.start_time or 0 for m in before.measurements)
    append_test(tmp_path / "next.nc", entry, spec, tmp_path / "third.nc")
    third = read_campaign(tmp_path / "third.nc").measurements[-1]
    assert third.name == "sine_next_2"
    assert third.experiment.start_time > added.experiment.start_time + 10.0
    force, earlier = (m.outputs["lateral_force"] for m in (third, added))
    assert 20.0 < np.std(force[:500] - earlier[:500]) < 40.0
    assert np.ptp(added.outputs["lateral_force"]) > 200
    with pytest.raises(ValueError, match="runs sines and steps"):
        append_test(path, entry, {**spec, "conditions": {"vertical_force": 5000.0}}, tmp_path / "other.nc")
    assert not (tmp_path / "other.nc").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "effect", "number"), [(1, "cubic_stiffness", 5), (3, "carcass_stiffness", 18)])
def test_a_softening_carcass_holds_to_the_end_of_the_longest_test(seed, effect, number, tmp_path):
    # at the size first drawn it gives way after 4 s of a step test, past what strengths are judged by
    path = made(tmp_path, Slot(seed, "effect", effect, number))
    assert [issue for issue in check_campaign(path) if issue.severity == "error"] == []
