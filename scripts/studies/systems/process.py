"""Lags, RC circuits, tanks, thermal masses and motors."""

from __future__ import annotations

import numpy as np

from systems.family import Draw, Family, Loose, Split, log_uniform

VOLTAGE, READING = ("input_voltage", "V"), ("output_voltage", "V")


def lag_draw(rng):
    gain, tau, size = log_uniform(rng, 1e-3, 1e3), log_uniform(rng, 1e-6, 1e4), log_uniform(rng, 0.1, 10)
    extras = {"T_2": 0.3 * tau, "delay": 0.2 * tau}
    return Draw({"K": gain, "T": tau}, 1 / tau, size, scales=(gain * size,) * 2, extras=extras)


def lag_rates(p, x, u):
    return (p["K"] * u[0] - x[0]) / p["T"], (x[0] - x[1]) / p["T_2"] if p["T_2"] else 0.0


LAG = Family(
    "lag",
    "first-order lag",
    {"K": "1", "T": "s"},
    (VOLTAGE,),
    (READING,),
    (("y", "V"),),
    {"y": "(K * input_voltage - y) / T", "output_voltage": "y"},
    lag_draw,
    lambda p, x, u: [x[1] if p["T_2"] else x[0]],
    lag_rates,
    flaws={"second time constant": "T_2", "delay": "delay"},
    ridges=(Split("K", "product"),),
)


def rc_draw(rng):
    ohm, farad, size = log_uniform(rng, 1e2, 1e8), log_uniform(rng, 1e-12, 1e-4), log_uniform(rng, 0.1, 100)
    load = 1 / (ohm * rng.uniform(1, 5))
    rate = (1 / ohm + load) / farad
    offset = size * rng.uniform(-0.1, 0.1)
    values = {"R": ohm, "C": farad, "U_0": offset}
    extras, boxes = {"T_2": 0.3 / rate}, {"U_0": size}
    return Draw(values, rate, size, scales=(size, size), constants={"G_L": load}, extras=extras, boxes=boxes)


def rc_rates(p, x, u):
    current = (u[0] - x[0]) / p["R"] - p["G_L"] * x[0]
    return current / p["C"], (x[0] - x[1]) / p["T_2"] if p["T_2"] else 0.0


RC = Family(
    "rc",
    "RC circuit",
    {"R": "ohm", "C": "F", "U_0": "V", "G_L": "1/ohm"},
    (VOLTAGE,),
    (READING,),
    (("u_C", "V"),),
    {"u_C": "((input_voltage - u_C) / R - G_L * u_C) / C", "output_voltage": "u_C + U_0"},
    rc_draw,
    lambda p, x, u: [(x[1] if p["T_2"] else x[0]) + p["U_0"]],
    rc_rates,
    flaws={"second stage": "T_2"},
    ridges=(Loose("no load: only R C acts", ("R", "C"), constants={"G_L": 0.0}),),
)


def tank_draw(rng):
    level, tau, area = log_uniform(rng, 1e-3, 10), log_uniform(rng, 1, 1e4), log_uniform(rng, 1e-6, 1e2)
    outflow = area * level / tau
    values = {"q": outflow / 5, "c": outflow / np.sqrt(level)}
    extras = {"weir": 20 * outflow / level, "leak": 0.3 * outflow / level}
    constants = {"A": area, "h_0": level, "brim": 1.1 * level}
    return Draw(values, 1 / tau, 2.5, 5.0, (level,), constants, extras)


def tank_rates(p, x, u):
    lost = p["leak"] * x[0] + p["weir"] * max(x[0] - p["brim"], 0.0)
    return ((p["q"] * u[0] - p["c"] * np.sqrt(max(x[0], 0.0)) - lost) / p["A"],)


TANK = Family(
    "tank",
    "single tank",
    {"q": "m^3/s/V", "c": "m^2.5/s", "A": "m^2", "h_0": "m"},
    (VOLTAGE,),
    (("level", "m"),),
    (("h", "m"),),
    {"h": "(q * input_voltage - c * ca.sqrt(ca.fmax(h, 1e-6 * h_0))) / A", "level": "h"},
    tank_draw,
    lambda p, x, u: [x[0]],
    tank_rates,
    {"h": "h_0"},
    lambda p: [p["h_0"]],
    flaws={"overflow": "weir", "leak": "leak"},
    ridges=(Loose("area free: only ratios act", ("q", "c", "A"), ("A",)),),
)


def tanks_draw(rng):
    level, tau, area = log_uniform(rng, 1e-2, 10), log_uniform(rng, 1, 1e4), log_uniform(rng, 1e-6, 1e2)
    second, share = area * rng.uniform(0.5, 2), rng.uniform(0.5, 1.5)
    outflow = area * level / tau
    values = {"q": outflow / 5, "c_1": outflow / np.sqrt(level), "c_2": outflow / np.sqrt(share * level)}
    constants = {"A_1": area, "A_2": second, "h_1": level, "h_2": share * level, "brim": 1.1 * level}
    extras = {"weir": 20 * outflow / level}
    return Draw(values, 1 / tau, 2.5, 5.0, (level, level), constants, extras)


def tanks_rates(p, x, u):
    between = p["c_1"] * np.sqrt(max(x[0], 0.0))
    lost = p["weir"] * max(x[0] - p["brim"], 0.0)
    return (p["q"] * u[0] - between - lost) / p["A_1"], (between - p["c_2"] * np.sqrt(max(x[1], 0.0))) / p["A_2"]


TANKS = Family(
    "tanks",
    "two tanks",
    {"q": "m^3/s/V", "c_1": "m^2.5/s", "c_2": "m^2.5/s", "A_1": "m^2", "A_2": "m^2", "h_1": "m", "h_2": "m"},
    (VOLTAGE,),
    (("level", "m"),),
    (("upper", "m"), ("lower", "m")),
    {
        "upper": "(q * input_voltage - c_1 * ca.sqrt(ca.fmax(upper, 1e-6 * h_1))) / A_1",
        "lower": "(c_1 * ca.sqrt(ca.fmax(upper, 1e-6 * h_1)) - c_2 * ca.sqrt(ca.fmax(lower, 1e-6 * h_2))) / A_2",
        "level": "lower",
    },
    tanks_draw,
    lambda p, x, u: [x[1]],
    tanks_rates,
    {"upper": "h_1", "lower": "h_2"},
    lambda p: [p["h_1"], p["h_2"]],
    flaws={"overflow of the upper tank": "weir"},
    ridges=(Loose("both areas free", ("q", "c_1", "c_2", "A_1", "A_2"), ("A_1", "A_2")),),
)


def thermal_draw(rng):
    heat, tau, rise = log_uniform(rng, 1e-8, 1e6), log_uniform(rng, 1e-3, 1e5), log_uniform(rng, 2, 80)
    loss = heat / tau
    power = loss * rise
    values = {"C": heat, "h": loss, "T_a": 293 + rng.uniform(-10, 10)}
    extras = {"radiation": 0.2 * loss / 300**3, "T_2": 0.3 * tau}
    scales, boxes = (rise, rise), {"T_a": 100.0}
    return Draw(values, 1 / tau, 0.5 * power, 0.5 * power, scales, {"eta": 1.0}, extras, boxes)


def thermal_rates(p, x, u):
    body = p["T_a"] + x[0]
    lost = p["h"] * x[0] + p["radiation"] * (body**4 - p["T_a"] ** 4)
    return (p["eta"] * u[0] - lost) / p["C"], (x[0] - x[1]) / p["T_2"] if p["T_2"] else 0.0


THERMAL = Family(
    "thermal",
    "thermal mass",
    {"C": "J/K", "h": "W/K", "T_a": "K", "eta": "1"},
    (("heating_power", "W"),),
    (("body_temperature", "K"),),
    (("T", "K"),),
    {"T": "(eta * heating_power - h * (T - T_a)) / C", "body_temperature": "T"},
    thermal_draw,
    lambda p, x, u: [p["T_a"] + (x[1] if p["T_2"] else x[0])],
    thermal_rates,
    {"T": "T_a"},
    flaws={"radiation": "radiation", "second thermal mass": "T_2"},
    ridges=(Split("h", "sum"), Loose("efficiency free", ("C", "h", "eta"), ("eta",))),
)


def motor_draw(rng):
    ohm, slow = log_uniform(rng, 1e-2, 1e3), log_uniform(rng, 1e-3, 10)
    constant, inertia = log_uniform(rng, 1e-5, 10), 1.0
    damping = constant**2 / ohm * rng.uniform(0.2, 1)
    inertia = slow * (damping + constant**2 / ohm)
    values = {"R": ohm, "L": ohm * slow * rng.uniform(0.1, 0.5), "K": constant, "J": inertia, "d": damping}
    speed = log_uniform(rng, 10, 1000)
    current = damping * speed / constant
    volts = ohm * current + constant * speed
    values |= {"M_f": 0.2 * damping * speed, "w_0": speed * rng.uniform(-0.05, 0.05)}
    extras = {"fan": 0.3 * damping / speed}
    scales, boxes = (current, speed), {"w_0": speed}
    return Draw(values, 1 / slow, volts, 0.0, scales, {"w_s": 0.05 * speed}, extras, boxes)


def motor_rates(p, x, u):
    friction = p["M_f"] * np.tanh(x[1] / p["w_s"]) + p["fan"] * abs(x[1]) * x[1]
    return (
        (u[0] - p["R"] * x[0] - p["K"] * x[1]) / p["L"],
        (p["K"] * x[0] - p["d"] * x[1] - friction) / p["J"],
    )


MOTOR = Family(
    "motor",
    "DC motor",
    {"R": "ohm", "L": "H", "K": "V s", "J": "kg m^2", "d": "N m s", "M_f": "N m", "w_0": "rad/s", "w_s": "rad/s"},
    (VOLTAGE,),
    (("armature_current", "A"), ("speed", "rad/s")),
    (("i", "A"), ("w", "rad/s")),
    {
        "i": "(input_voltage - R * i - K * w) / L",
        "w": "(K * i - d * w - M_f * ca.tanh(w / w_s)) / J",
        "armature_current": "i",
        "speed": "w + w_0",
    },
    motor_draw,
    lambda p, x, u: [x[0], x[1] + p["w_0"]],
    motor_rates,
    flaws={"drag of the fan": "fan"},
    ridges=(
        Split("R", "sum"),
        Loose("current not measured", ("R", "L", "J", "d", "M_f"), outputs=("speed",)),
    ),
)

FAMILIES = (LAG, RC, TANK, TANKS, THERMAL, MOTOR)
