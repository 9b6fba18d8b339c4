"""Oscillators, friction, pendulums and viscoelastic elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from systems.family import Draw, Family, Loose, Split, log_uniform, weaker

FORCE, STROKE, SPEED = ("force", "N"), ("displacement", "m"), ("velocity", "m/s")
TORQUE, ANGLE = ("drive_torque", "N m"), ("swing", "rad")


def oscillator_draw(rng):
    mass = log_uniform(rng, 1e-9, 1e6)
    frequency = log_uniform(rng, 0.2, 20) if mass > 1 else log_uniform(rng, 20, 1e5)
    omega, zeta = 2 * np.pi * frequency, log_uniform(rng, 0.03, 0.4)
    size = log_uniform(rng, 1e-8, 1e-2)
    k = mass * omega**2
    values = {"m": mass, "d": 2 * zeta * mass * omega, "k": k, "x_0": 0.1 * size * rng.normal()}
    extras = {"k_3": 0.2 * k / size**2, "F_c": 0.1 * k * size, "k_2": 0.2 * k / size}
    drive = k * size * max(2 * zeta, 0.15)
    constants = {"g": 1.0, "v_c": 0.02 * omega * size}
    return Draw(values, omega, drive, 0.0, (size, omega * size), constants, extras, {"x_0": size})


def oscillator_rates(p, x, u):
    spring = p["k"] * x[0] + p["k_2"] * x[0] ** 2 + p["k_3"] * x[0] ** 3
    friction = p["F_c"] * np.tanh(x[1] / p["v_c"]) if p["F_c"] else 0.0
    return x[1], (p["g"] * u[0] - p["d"] * x[1] - spring - friction) / p["m"]


OSCILLATOR = Family(
    "oscillator",
    "mass, spring and damper",
    {"m": "kg", "d": "N s/m", "k": "N/m", "x_0": "m", "g": "1"},
    (FORCE,),
    (STROKE,),
    (("x", "m"), ("v", "m/s")),
    {"x": "v", "v": "(g * force - d * v - k * x) / m", "displacement": "x + x_0"},
    oscillator_draw,
    lambda p, x, u: [x[0] + p["x_0"]],
    oscillator_rates,
    flaws={"cubic stiffness": "k_3", "Coulomb friction": "F_c"},
    ridges=(Split("k", "sum"), Loose("gain of the force free", ("m", "d", "k", "g"), ("g",))),
)


def duffing_draw(rng):
    draw = oscillator_draw(rng)
    del draw.values["x_0"]
    draw.values["k_3"] = draw.values["k"] / draw.scales[0] ** 2
    return draw


DUFFING = Family(
    "duffing",
    "Duffing oscillator",
    {"m": "kg", "d": "N s/m", "k": "N/m", "k_3": "N/m^3"},
    (FORCE,),
    (STROKE,),
    (("x", "m"), ("v", "m/s")),
    {"x": "v", "v": "(force - d * v - k * x - k_3 * x**3) / m", "displacement": "x"},
    duffing_draw,
    lambda p, x, u: [x[0]],
    lambda p, x, u: oscillator_rates({**p, "g": 1.0}, x, u),
    flaws={"quadratic stiffness": "k_2"},
    ridges=(
        Split("k_3", "product"),
        Loose("amplitude too small for k_3", ("k_3",), change=lambda draw: weaker(draw, 1e-3)),
    ),
)


def rig_draw(rng):
    k, size, omega = log_uniform(rng, 1e-3, 1e9), log_uniform(rng, 1e-7, 0.1), log_uniform(rng, 0.1, 1e4)
    d = k / omega * log_uniform(rng, 0.2, 3)
    values = {"k": k, "d": d, "F_0": 0.2 * k * size * rng.normal()}
    extras = {"F_c": 0.1 * k * size, "k_3": 0.2 * k / size**2}
    constants, boxes = {"v_c": 0.05 * size * omega}, {"F_0": k * size}
    return Draw(values, omega, size, constants=constants, extras=extras, boxes=boxes)


def rig_response(p, x, u):
    friction = p["F_c"] * np.tanh(u[1] / p["v_c"]) if p["F_c"] else 0.0
    return [p["k"] * u[0] + p["d"] * u[1] + p["F_0"] + p["k_3"] * u[0] ** 3 + friction]


RIG = Family(
    "rig",
    "spring and damper on a rig",
    {"k": "N/m", "d": "N s/m", "F_0": "N"},
    (STROKE, SPEED),
    (FORCE,),
    (),
    {"force": "k * displacement + d * velocity + F_0"},
    rig_draw,
    rig_response,
    flaws={"Coulomb friction": "F_c", "cubic stiffness": "k_3"},
    ridges=(Split("d", "product"),),
    stepped=False,
)


def friction_draw(rng):
    draw = rig_draw(rng)
    k, size, speed = draw.values["k"], draw.amplitude, draw.amplitude * draw.rate
    values = {
        "k": k,
        "d": draw.values["d"],
        "F_c": k * size * rng.uniform(0.3, 2),
        "v_s": speed * rng.uniform(0.1, 0.5),
    }
    constants, extras = {"v_p": 0.3 * speed}, {"F_p": 0.3 * values["F_c"]}
    return Draw(values, draw.rate, size, constants=constants, extras=extras)


def friction_response(p, x, u):
    peak = p["F_p"] * np.exp(-((u[1] / p["v_p"]) ** 2)) if p["F_p"] else 0.0
    return [p["k"] * u[0] + p["d"] * u[1] + (p["F_c"] + peak) * np.tanh(u[1] / p["v_s"])]


def sharp(draw):
    """Friction whose reversal is far below the speeds of the tests."""
    return replace(draw, values={**draw.values, "v_s": 1e-4 * draw.amplitude * draw.rate})


FRICTION = Family(
    "friction",
    "spring, damper and friction",
    {"k": "N/m", "d": "N s/m", "F_c": "N", "v_s": "m/s"},
    (STROKE, SPEED),
    (FORCE,),
    (),
    {"force": "k * displacement + d * velocity + F_c * ca.tanh(velocity / v_s)"},
    friction_draw,
    friction_response,
    flaws={"Stribeck peak": "F_p"},
    ridges=(Split("F_c", "product"), Loose("reversal too sharp for v_s", ("v_s",), change=sharp)),
    stepped=False,
)


def sledge_draw(rng):
    mass, slow, speed = log_uniform(rng, 1e-6, 1e6), log_uniform(rng, 1e-2, 1e2), log_uniform(rng, 1e-4, 10)
    damping = mass / slow
    values = {"m": mass, "d": damping, "F_c": damping * speed * rng.uniform(0.2, 0.8)}
    extras = {"drag": 0.3 * damping / speed, "delay": 0.15 * slow}
    constants = {"v_s": 1e-2 * speed, "g": 1.0}
    return Draw(values, 1 / slow, 2 * damping * speed, 0.0, (speed,), constants, extras)


def sledge_rates(p, x, u):
    resisting = p["d"] * x[0] + p["F_c"] * np.tanh(x[0] / p["v_s"]) + p["drag"] * abs(x[0]) * x[0]
    return ((p["g"] * u[0] - resisting) / p["m"],)


SLEDGE = Family(
    "sledge",
    "sledge with sharp friction",
    {"m": "kg", "d": "N s/m", "F_c": "N", "v_s": "m/s", "g": "1"},
    (FORCE,),
    (SPEED,),
    (("v", "m/s"),),
    {"v": "(g * force - d * v - F_c * ca.tanh(v / v_s)) / m", "velocity": "v"},
    sledge_draw,
    lambda p, x, u: [x[0]],
    sledge_rates,
    flaws={"quadratic drag": "drag", "delay": "delay"},
    ridges=(Loose("gain of the force free", ("m", "d", "F_c", "g"), ("g",)),),
)


def pendulum_draw(rng):
    length, mass = log_uniform(rng, 1e-2, 50), log_uniform(rng, 1e-4, 1e4)
    inertia, weight = mass * length**2, mass * 9.81 * length
    omega = np.sqrt(weight / inertia)
    damping = 2 * log_uniform(rng, 0.05, 0.3) * omega * inertia
    values = {"J": inertia, "d": damping, "G": weight}
    extras = {"M_c": 0.05 * weight, "arc": 0.5}
    return Draw(values, omega, 0.3 * weight, 0.0, (1.0, omega), {"g": 1.0, "w_c": 0.02 * omega}, extras)


def pendulum_rates(p, x, u):
    friction = p["M_c"] * np.tanh(x[1] / p["w_c"]) if p["M_c"] else 0.0
    return x[1], (u[0] - p["d"] * x[1] - p["G"] * np.sin(x[0]) - friction) / p["J"]


def linear_rates(p, x, u):
    lever = np.sin(p["arc"] * x[0]) / p["arc"] if p["arc"] else x[0]
    return x[1], (p["g"] * u[0] - p["d"] * x[1] - p["G"] * lever) / p["J"]


PENDULUM = Family(
    "pendulum",
    "pendulum",
    {"J": "kg m^2", "d": "N m s", "G": "N m"},
    (TORQUE,),
    (ANGLE,),
    (("phi", "rad"), ("w", "rad/s")),
    {"phi": "w", "w": "(drive_torque - d * w - G * ca.sin(phi)) / J", "swing": "phi"},
    pendulum_draw,
    lambda p, x, u: [x[0]],
    pendulum_rates,
    flaws={"Coulomb friction": "M_c"},
    ridges=(Split("G", "product"),),
)

LINEAR_PENDULUM = Family(
    "linear_pendulum",
    "linearised pendulum",
    {"J": "kg m^2", "d": "N m s", "G": "N m", "g": "1"},
    (TORQUE,),
    (ANGLE,),
    (("phi", "rad"), ("w", "rad/s")),
    {"phi": "w", "w": "(g * drive_torque - d * w - G * phi) / J", "swing": "phi"},
    pendulum_draw,
    lambda p, x, u: [x[0]],
    linear_rates,
    flaws={"sine of the angle": "arc"},
    ridges=(Loose("gain of the torque free", ("J", "d", "G", "g"), ("g",)),),
)


def zener_draw(rng):
    k, size, tau = log_uniform(rng, 1e-3, 1e9), log_uniform(rng, 1e-7, 0.1), log_uniform(rng, 1e-4, 1e3)
    k_1 = k * log_uniform(rng, 0.3, 5)
    values = {"k": k, "k_1": k_1, "tau": tau, "d": k * tau * rng.uniform(0.02, 0.1)}
    scales, constants = (k_1 * size, k_1 * size), {"tau_2": tau / 10}
    return Draw(values, 1 / tau, size, 0.0, scales, constants, {"k_2": 0.3 * k_1})


def zener_rates(p, x, u):
    return p["k_1"] * u[1] - x[0] / p["tau"], p["k_2"] * u[1] - x[1] / p["tau_2"] if p["k_2"] else 0.0


def too_fast(draw):
    """A branch that has relaxed before the fastest test shows it."""
    fast = {"tau": 1e-4 / draw.rate, "d": draw.values["k"] / draw.rate}
    return replace(draw, values={**draw.values, **fast})


ZENER = Family(
    "zener",
    "Zener element",
    {"k": "N/m", "k_1": "N/m", "tau": "s", "d": "N s/m"},
    (STROKE, SPEED),
    (FORCE,),
    (("branch", "N"),),
    {"branch": "k_1 * velocity - branch / tau", "force": "k * displacement + d * velocity + branch"},
    zener_draw,
    lambda p, x, u: [p["k"] * u[0] + p["d"] * u[1] + x[0] + x[1]],
    zener_rates,
    flaws={"second branch": "k_2"},
    ridges=(
        Split("k", "sum"),
        Loose("branch too fast for the tests", ("k_1", "tau"), change=too_fast),
    ),
    stepped=False,
)

FAMILIES = (OSCILLATOR, DUFFING, RIG, FRICTION, SLEDGE, PENDULUM, LINEAR_PENDULUM, ZENER)
