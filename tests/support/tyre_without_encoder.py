"""A tyre on a drum without an encoder: the paper's equations by scipy, orders at angles that nobody wrote down."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from mofit.data import Campaign, Experiment, Measurement

SPEED, RADIUS, DRUM, LOAD = 60 / 3.6, 0.305, 0.61, 3600.0
KNOWN = {"dF0": 62e3, "s_M": 0.13, "F_M": 3100.0, "c_y": 121819.0, "p_y": -7.547}
DAMPING, BRANCH, BRANCH_DAMPING = 281.0, 19910.0, 7535.0
CONDITIONS = {"longitudinal_velocity": SPEED, "vertical_force": LOAD, "dynamic_rolling_radius": RADIUS}
FREQUENCIES = (0.5, 1.0, 2.0, 3.0, 4.0)
RATE, DURATION, NOISE = 100.0, 10.0, 20.0


def tyre_campaign(
    *,
    wheel: float = 0.0,
    drum: float = 0.0,
    lag: float = 0.0,
    offsets: float = 0.0,
    radius_error: float = 0.0,
    seed: int = 1,
    frequencies: tuple[float, ...] = FREQUENCIES,
    sweep: float = 0.0,
) -> Campaign:
    """Sines of 2 degrees; with ``sweep``, Hz, chirps to frequencies as much higher.

    ``wheel``: amplitude of the wheel's force variation, N; ``drum``: of the load's modulation, relative; ``lag``:
    length of the contact patch's lag, m; ``offsets``: standard deviation of the zero offsets of the tests, N;
    ``radius_error``: by how much the radius that the file states is too large. Every test begins at angles of its own.
    """
    rng, tests = np.random.default_rng(seed), []
    conditions = {**CONDITIONS, "dynamic_rolling_radius": (1 + radius_error) * RADIUS}
    for frequency in frequencies:
        time = np.arange(round(DURATION * RATE)) / RATE
        at_wheel, at_drum = rng.uniform(0, 2 * np.pi, 2)
        force = _force(time, (frequency, sweep), lag, drum, at_drum) + wheel * np.cos(SPEED / RADIUS * time + at_wheel)
        force += offsets * rng.standard_normal() + NOISE * rng.standard_normal(len(time))
        steer, kind = _steer(time, frequency, sweep), "chirp" if sweep else "sine"
        experiment = Experiment(
            f"{frequency:g} Hz", kind, time, {"slip_angle": steer}, conditions, frequency, np.deg2rad(2.0)
        )
        units = {"slip_angle": "rad", "lateral_force": "N"}
        tests.append(Measurement(experiment, {"lateral_force": force}, units))
    return Campaign("tyre without an encoder", "simulated", conditions, tuple(tests))


def _steer(time: np.ndarray, frequency: float, sweep: float) -> np.ndarray:
    return np.deg2rad(2.0) * np.sin(2 * np.pi * (frequency + 0.5 * sweep * time / DURATION) * time)


def _force(time: np.ndarray, excited: tuple[float, float], lag: float, drum: float, at_drum: float) -> np.ndarray:
    """Force of the contact patch, from rest."""

    def patch(t, state):
        deflection, branch, lagged = state
        angle = lagged if lag else _steer(t, *excited)
        transport = SPEED * np.cos(angle) + 0.01
        slip = SPEED * np.sin(angle) / transport
        size = abs(slip) / KNOWN["s_M"]
        secant = KNOWN["dF0"] / (1 + size * (size + KNOWN["dF0"] * KNOWN["s_M"] / KNOWN["F_M"] - 2))
        secant *= 1 + drum * np.cos(SPEED / DRUM * t + at_drum)
        elastic = KNOWN["c_y"] * (1 + KNOWN["p_y"] * abs(deflection)) * deflection + BRANCH * (deflection - branch)
        rate = transport * (secant * slip - elastic) / (transport * DAMPING + secant)
        return secant, slip, transport, rate

    def change(t, state):
        _, _, _, rate = patch(t, state)
        steer = _steer(t, *excited)
        return [rate, BRANCH / BRANCH_DAMPING * (state[0] - state[1]), (steer - state[2]) * SPEED / lag if lag else 0.0]

    found = solve_ivp(change, (0, time[-1]), [0.0, 0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-11, max_step=0.02)
    secant, slip, transport, rate = np.array([patch(t, state) for t, state in zip(time, found.y.T, strict=True)]).T
    return secant * (slip - rate / transport)
