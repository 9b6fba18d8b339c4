"""Records that begin in their steady state: a lightly damped oscillator, by its closed form."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.diagnose import diagnose
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import build_system, find_model
from mofit.sampling import laplace_covariance
from mofit.simulation import ExperimentData, Simulator

STIFFNESS, FREQUENCY, DAMPING = 1000.0, 12.0, 0.02
DRIVEN = (5.0, 9.0, 11.0, 13.0, 20.0)


def campaign(at_rest: Collection[float] = (), damping: float = DAMPING, misread: Collection[float] = ()) -> Campaign:
    """Sines of 4 s; those ``at_rest`` ring up, the others have rung up before.

    Those ``misread`` are measured 10 % too large for the first 0.4 s, as if they decayed.
    """
    rng, tests, time = np.random.default_rng(3), [], np.arange(1000) / 250
    natural = 2 * np.pi * FREQUENCY
    damped = natural * np.sqrt(1 - damping**2)
    for frequency in DRIVEN:
        turning = np.exp(1j * (2 * np.pi * frequency * time + rng.uniform(0, 2 * np.pi)))
        ratio = frequency / FREQUENCY
        response = turning / (STIFFNESS * (1 - ratio**2 + 2j * damping * ratio))
        motion = response.imag
        if frequency in at_rest:
            start, speed = motion[0], (2j * np.pi * frequency * response[0]).imag
            sine = (speed + damping * natural * start) / damped
            decay = np.exp(-damping * natural * time)
            motion = motion - decay * (start * np.cos(damped * time) + sine * np.sin(damped * time))
        motion = motion * (1 + 0.1 * (time < 0.4) * (frequency in misread))
        motion = motion + 0.01 * np.ptp(motion) * rng.standard_normal(len(time))
        experiment = Experiment(f"{frequency:g} Hz", "sine", time, {"force": turning.imag}, frequency=frequency)
        tests.append(Measurement(experiment, {"displacement": motion}, {"force": "N", "displacement": "m"}))
    return Campaign("oscillator", "simulated", {}, tuple(tests))


@pytest.mark.parametrize("at_rest", [(), (9.0, 13.0), DRIVEN])
def test_the_start_of_a_record_does_not_bias_the_damping(at_rest: tuple[float, ...]) -> None:
    settings = Settings(evaluations=300, jobs=1)
    found = locate_minima(campaign(at_rest), find_model("oscillator"), settings)
    minimum, _ = adjusted_modes(found.posterior, found.minima, settings)[0]
    space = found.posterior.space
    values = dict(zip(space.names, space.from_unit(minimum.point), strict=True))
    sd = np.sqrt(np.diag(laplace_covariance(minimum.hessian))) * space.derivative(np.array(list(values.values())))
    off = [(values[name] - true) / sd[space.index(name)] for name, true in (("f_0", FREQUENCY), ("zeta", DAMPING))]
    assert np.all(np.abs(off) < 4)
    led = {m.name for m, signal in zip(found.problem.measurements, found.problem.signals, strict=True) if signal.lead}
    assert led == {f"{frequency:g} Hz" for frequency in DRIVEN if frequency not in at_rest}
    said = [warning for warning in found.warnings if "begins in its steady state" in warning]
    assert len(said) == bool(led)


def test_a_record_that_seems_to_decay_is_led_in_as_the_others_are() -> None:
    found = locate_minima(campaign(misread=(11.0,)), find_model("oscillator"), Settings(evaluations=300, jobs=1))
    transients = [signal.transient for signal in found.problem.signals]
    assert transients[DRIVEN.index(11.0)] > 0
    assert sum(transient > 0 for transient in transients) == 1
    assert all(signal.lead for signal in found.problem.signals)


@pytest.mark.slow
def test_the_result_holds_the_inputs_as_recorded(tmp_path) -> None:
    """Not what acts on the model before."""
    data, settings = campaign(), Settings(evaluations=300, jobs=1, sample=False)
    _, tree = identify(data, find_model("oscillator"), settings, out=tmp_path / "run")
    assert "begins in its steady state" in tree.attrs["warnings"]
    for test in data.measurements:
        assert tree[f"constant_data/{test.name}_force"].values == pytest.approx(test.channel("force"))


@pytest.mark.parametrize("damping", [0.1, 0.2])
def test_the_lead_is_as_long_as_the_memory_of_the_model(damping: float) -> None:
    """Which is 10 / (2 pi 12 Hz damping), to e^-10, and less than half of a record."""
    found = locate_minima(campaign(damping=damping), find_model("oscillator"), Settings(evaluations=300, jobs=1))
    memory = 10 / (2 * np.pi * FREQUENCY * damping)
    leads = [signal.lead for signal in found.problem.signals if signal.lead]
    assert leads
    assert all(memory / 10 < lead < 2 * memory for lead in leads)


@pytest.mark.slow
@pytest.mark.parametrize("at_rest", [(), DRIVEN])
def test_neither_start_is_a_gap(at_rest: tuple[float, ...]) -> None:
    found = diagnose(campaign(at_rest), "oscillator", settings=Settings(evaluations=300, jobs=1))
    assert found.conclusion.verdict == "none"
    assert np.all(np.array(list(found.noise_floor.values())) < 0.025)


def test_inputs_led_in_are_those_of_a_longer_record() -> None:
    """Outputs, sensitivities and cost of the last part of a record, simulated from its first sample on."""
    model, rng = find_model("oscillator"), np.random.default_rng(0)
    system, lead, count = build_system(model), 60, 100
    inputs, measured = rng.standard_normal((lead + count, 1)), rng.standard_normal((lead + count, 1))
    weights = np.where(np.arange(lead + count) < lead, 0.0, 1.0)[:, None]
    whole = ExperimentData("whole", 0.01, inputs, "cubic", np.empty(0), measured, weights)
    led = replace(whole, measured=measured[lead:], weights=weights[lead:], lead=lead)
    values = np.array([[1000.0, 12.0, 0.02, 1e-3]])
    outputs = []
    for one in (whole, led):
        simulator = Simulator(system, [one], jobs=1, steps=2)
        (signal, slopes), *_ = simulator.sensitivities(values)
        outputs.append((signal[:, -count:], slopes[:, -count:], simulator.cost(values)))
    for a, b in zip(*outputs, strict=True):
        np.testing.assert_array_equal(a, b)
