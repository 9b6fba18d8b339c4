"""Free decays from unknown initial states: what is missing shows in the response itself, integrated by SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.diagnose import diagnose
from mofit.identification.settings import Settings
from mofit.models import find_effect, find_model, with_effects

#: initial position (m), velocity (m/s) and zero offset (m) of each record
STARTS = ((0.02, 0.0, 1e-4), (0.0, 0.5, 0.0), (-0.01, 0.1, -1e-4), (0.03, -0.2, 0.0))
#: the model's stiffness is fixed at 1000 N/m: forces of a mass of 1 kg grow by 2.5
LAWS = {
    "none": lambda x, v: 0.0,
    "cubic": lambda x, v: 4e5 * x**3,
    "quadratic": lambda x, v: 8 * v * abs(v),
}


def decay(law: str, x: float, v: float, time: np.ndarray) -> np.ndarray:
    """Displacement of a mass of 1 kg on 400 N/m and 0.4 N s/m."""
    found = solve_ivp(
        lambda t, y: [y[1], -400 * y[0] - 0.4 * y[1] - LAWS[law](y[0], y[1])],
        (0, 4), [x, v], t_eval=time, max_step=1e-3, rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    return found.y[0]


def with_friction(x: float, v: float, time: np.ndarray, force: float = 0.3) -> np.ndarray:
    """The same with Coulomb friction [N], in closed form, from turn to turn around an end of the zone of rest."""
    found, rate, begun, done = np.empty(len(time)), np.sqrt(400 - 0.2**2), 0.0, 0
    while done < len(time):
        if v == 0 and abs(400 * x) <= force:
            found[done:] = x
            break
        middle = -np.sign(v or -x) * force / 400
        cosine, sine = x - middle, (v + 0.2 * (x - middle)) / rate
        turn = np.arctan2(rate * sine - 0.2 * cosine, rate * cosine + 0.2 * sine) / rate % (np.pi / rate)
        turn += np.pi / rate * (turn < 1e-9)  # from rest half a period
        inside = int(np.sum(time[done:] - begun < turn))
        since = np.append(time[done : done + inside] - begun, turn)
        moved = middle + np.exp(-0.2 * since) * (cosine * np.cos(rate * since) + sine * np.sin(rate * since))
        found[done : done + inside], x, v = moved[:-1], moved[-1], 0.0
        done, begun = done + inside, begun + turn
    return found


def decays(law: str, colour: float = 0.0, seed: int = 0) -> Campaign:
    """Four taps; noise of 0.1 mm, autoregressive with the coefficient ``colour``."""
    rng, time, tests = np.random.default_rng(seed), np.arange(800) / 200, []
    for k, (x, v, offset) in enumerate(STARTS):
        clean = with_friction(x, v, time) if law == "friction" else decay(law, x, v, time)
        noise = 1e-4 * np.sqrt(1 - colour**2) * lfilter([1.0], [1.0, -colour], rng.normal(size=len(time)))
        experiment = Experiment(f"tap{k}", "free", time, {}, {})
        tests.append(Measurement(experiment, {"displacement": clean + offset + noise}, {"displacement": "m"}))
    return Campaign("taps", "simulated", {}, tuple(tests))


def diagnosed(campaign: Campaign):
    """The oscillator with an initial state and an offset per record."""
    model = with_effects(find_model("oscillator"), find_effect("start:position"), find_effect("start:velocity"))
    settings = Settings(seed=0, jobs=1, fixed={"k": 1e3}, scopes={"x_0": "test"})
    return diagnose(campaign, model, (), settings)


@pytest.mark.slow
def test_coloured_noise_is_no_gap() -> None:
    assert diagnosed(decays("none", 0.8, seed=1)).conclusion.verdict == "none"


@pytest.mark.parametrize(
    ("law", "family", "size", "value"),
    [
        ("cubic", "non-linear stiffness", "k_c", 1e6),
        pytest.param("quadratic", "non-linear damping", "d_2", 20.0, marks=pytest.mark.slow),
    ],
)
def test_the_law_of_a_decay_is_found(law: str, family: str, size: str, value: float) -> None:
    found = diagnosed(decays(law))
    (effect,) = found.conclusion.effects
    assert effect.family == family
    assert effect.parameters[size] == pytest.approx(value, rel=0.03)
    assert found.conclusion.verdict == "effect"


@pytest.mark.slow
def test_a_decay_that_friction_ends_is_no_noise() -> None:
    campaign = decays("friction")
    found = diagnosed(campaign)
    (effect,) = found.conclusion.effects
    assert (found.conclusion.verdict, effect.family) == ("effect", "friction")
    assert effect.parameters["F_d"] == pytest.approx(0.75, rel=0.02)
    for measurement in campaign.measurements:
        true = 1e-4 / np.ptp(measurement.channel("displacement"))
        (floor,) = (value for name, value in found.noise_floor.items() if name.startswith(measurement.name))
        assert floor == pytest.approx(true, rel=0.2)
