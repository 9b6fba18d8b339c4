"""Tyres with slip in one or both directions by SciPy: equations written out anew, nothing taken from mofit's models."""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

from mofit.data import Campaign, Experiment, Measurement

LATERAL = {
    "dF0": 62e3, "s_M": 0.13, "F_M": 3100.0, "c_y": 121_819.0, "p_y": -7.547, "d_y": 281.0, "c_M": 19_910.0,
    "d_M": 7_535.0,
}  # fmt: skip
LONGITUDINAL = {
    "dF0_x": 95e3, "s_Mx": 0.11, "F_Mx": 3400.0, "c_x": 300e3, "p_x": -9.0, "d_x": 350.0, "c_Mx": 60e3, "d_Mx": 6_000.0
}  # fmt: skip
SPEED = 60 / 3.6
UNITS = {"slip_angle": "rad", "turn_slip": "1/m", "slip_ratio": "1", "lateral_force": "N", "longitudinal_force": "N"}
Signal = Callable[[float], float]


def tmeasy(s: float, slope: float, s_max: float, f_max: float) -> float:
    """Force over a slip of at least 0."""
    if s <= s_max:
        return slope * s / (1 + s / s_max * (s / s_max + slope * s_max / f_max - 2))
    share = min((s - s_max) / (2 * s_max), 1.0)
    return f_max * (1 - 0.05 * share**2 * (3 - 2 * share))


def combined(sx: float, sy: float, p: Mapping[str, float], norms: tuple[float, float]) -> float:
    """Force over generalised slip."""
    s = np.hypot(sx, sy)
    if s < 1e-9:
        s, sx, sy = 1e-9, 1e-9 / np.sqrt(2), 1e-9 / np.sqrt(2)
    cos, sin = sx / s, sy / s
    slope = np.hypot(p["dF0_x"] * norms[0] * cos, p["dF0"] * norms[1] * sin)
    s_max = np.hypot(p["s_Mx"] / norms[0] * cos, p["s_M"] / norms[1] * sin)
    return tmeasy(s, slope, s_max, np.hypot(p["F_Mx"] * cos, p["F_M"] * sin)) / s


def norm_factors(p: Mapping[str, float]) -> tuple[float, float]:
    """Of the longitudinal and the lateral slip."""
    x, y = p["F_Mx"] / p["dF0_x"], p["F_M"] / p["dF0"]
    sum_s = p["s_Mx"] + p["s_M"]
    return p["s_Mx"] / sum_s + x / (x + y), p["s_M"] / sum_s + y / (x + y)


def forces(
    p: Mapping[str, float],
    time: np.ndarray,
    slip_ratio: Signal | None,
    slip_angle: Signal | None,
    speed: float = SPEED,
    turn_slip: Signal | None = None,
) -> np.ndarray:
    """Longitudinal and lateral force, shape (2, n), of a tyre that starts at rest without slip.

    A direction without a signal has no curve of its own: the tyre is that of the other direction. Turn slip acts on
    the lever ``l_phi``.
    """
    turn = turn_slip or (lambda t: 0.0)
    ratio, angle = slip_ratio or (lambda t: 0.0), slip_angle or (lambda t: 0.0)
    both = slip_ratio is not None and slip_angle is not None
    p = {**LATERAL, **LONGITUDINAL, "l_phi": 0.0, **p}
    norms = norm_factors(p) if both else (1.0, 1.0)
    spring = [(p["c_x"], p["p_x"], p["d_x"], p["c_Mx"], p["d_Mx"]), (p["c_y"], p["p_y"], p["d_y"], p["c_M"], p["d_M"])]

    def parts(t: float, state: np.ndarray):
        along = speed * np.cos(angle(t))
        turning = abs(along * (1 + ratio(t)))
        slide = (along * ratio(t), speed * (np.sin(angle(t)) + p["l_phi"] * turn(t)))
        transport = [turning * norm + 0.01 for norm in norms]
        slips = [one / over for one, over in zip(slide, transport, strict=True)]
        if both:
            f = combined(*slips, p, norms)
        else:
            k = 0 if slip_angle is None else 1
            curve = [(p["dF0_x"], p["s_Mx"], p["F_Mx"]), (p["dF0"], p["s_M"], p["F_M"])][k]
            size = max(abs(slips[k]), 1e-9)
            f = tmeasy(size, *curve) / size
        rates, outputs = np.zeros(4), np.zeros(2)
        for k, (c, q, d, c_m, d_m) in enumerate(spring):
            u, u_m = state[2 * k], state[2 * k + 1]
            elastic = c * (1 + q * abs(u)) * u + c_m * (u - u_m)
            # f (s - u'/v) = elastic + d u'
            rates[2 * k] = (f * slips[k] - elastic) / (d + f / transport[k])
            rates[2 * k + 1] = c_m * (u - u_m) / d_m
            outputs[k] = elastic + d * rates[2 * k]
        return rates, outputs

    found = solve_ivp(
        lambda t, x: parts(t, x)[0], (time[0], time[-1]), np.zeros(4), "LSODA", time, rtol=1e-8, atol=1e-11
    )
    return np.array([parts(t, x)[1] for t, x in zip(time, found.y.T, strict=True)]).T


def aligning_torque(
    force: np.ndarray, angle: np.ndarray, n_0: float, s_0: float, speed: float = SPEED, turned: np.ndarray | float = 0.0
) -> np.ndarray:
    """Torque of a lateral force under a slip angle: TMeasy's trail at the slip of the contact patch, s_E = 1.75 s_0.

    What turn slip adds to the sine of the angle is ``turned``.
    """
    slip = np.maximum(np.abs(speed * (np.sin(angle) + turned) / (speed * np.cos(angle) + 0.01)), 1e-9)
    curve = [LATERAL[name] for name in ("dF0", "s_M", "F_M")]
    secant = np.array([tmeasy(one, *curve) for one in slip]) / slip
    share, weight = np.abs(force) / secant / s_0, 1 / 1.75
    falling = (1 - weight) * (1 - share) + weight * (1 - (3 - 2 * share) * share**2)
    beyond = (weight - 1) * (share - 1) * (np.maximum(1.75 - share, 0) / 0.75) ** 2
    return -force * n_0 * np.where(share <= 1, falling, beyond)


def ratio_of(amplitude: float, frequency: float) -> Signal:
    """A sine that starts at zero."""
    return lambda t: amplitude * np.sin(2 * np.pi * frequency * t)


def measurement(
    name: str,
    time: np.ndarray,
    channels: Mapping[str, Signal],
    values: np.ndarray,
    noise: float,
    rng: np.random.Generator,
    kind: str = "free",
    frequency: float | None = None,
) -> Measurement:
    """A test with white noise on its forces: on those whose slip is given."""
    inputs = {channel: np.array([signal(t) for t in time]) for channel, signal in channels.items()}
    outputs = {
        force: values[k] + noise * rng.normal(size=len(time))
        for k, (force, slip) in enumerate((("longitudinal_force", "slip_ratio"), ("lateral_force", "slip_angle")))
        if slip in channels
    }
    experiment = Experiment(
        name, kind, time, inputs, {"longitudinal_velocity": SPEED, "vertical_force": 3600.0}, frequency
    )
    return Measurement(experiment, outputs, {one: UNITS[one] for one in (*inputs, *outputs)})


def campaign(*tests: Measurement) -> Campaign:
    """Tests of one simulated tyre."""
    return Campaign("tyre (simulated)", "simulated", {}, tests)
