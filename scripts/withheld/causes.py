"""What a campaign may hide: effects of the library, variants of them, and unmodelled ones outside the library.

Each cause turns knobs of the physics. Its size is the hypotenuse of its size knobs, in SI units, signed where there is
one. ``places`` says in which kinds of tests it acts; where several are given a campaign draws one. An effect that
acted in the calibration tests as well would be calibrated away if it were a wrong value of what they calibrate (gain,
slope, maximum, stiffness): such causes mean that the sine tests met another value than the calibration tests did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

SINES = ("sine",)
ROLLING = ("sine", "step")
ALL = ("sine", "step", "quasi_static")


@dataclass(frozen=True)
class Cause:
    """One cause: its ``typical`` sizes by knob, knobs of its ``shape`` with their range, and what it stands for."""

    name: str
    typical: Mapping[str, float]
    unit: str
    places: tuple[tuple[str, ...], ...]
    about: str
    shape: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    both_signs: bool = False
    #: as multiples of the typical size
    least: float = 0.01
    most: float = 4.0
    #: effect that a diagnosis should name for it
    alias: str | None = None


@dataclass(frozen=True)
class Drawn:
    """A cause at typical size as one campaign has it; ``at`` gives the knobs at a multiple of that."""

    cause: Cause
    direction: Mapping[str, float]
    shape: Mapping[str, float]
    place: tuple[str, ...]

    def at(self, multiple: float) -> dict[str, float]:
        """Knobs at a multiple of the typical size."""
        return {**{name: multiple * v for name, v in self.direction.items()}, **self.shape}

    def size(self, multiple: float) -> float:
        """Signed where it is a single knob."""
        parts = [multiple * v for v in self.direction.values()]
        return parts[0] if len(parts) == 1 else float(np.hypot(*parts))


def draw_cause(cause: Cause, rng: np.random.Generator) -> Drawn:
    """Sign or phase, shape and place."""
    if len(cause.typical) == 2:
        turn, scale = rng.uniform(0, 2 * np.pi), np.hypot(*cause.typical.values())
        direction = dict(zip(cause.typical, (scale * np.array([np.cos(turn), np.sin(turn)])).tolist(), strict=True))
    else:
        sign = -1.0 if cause.both_signs and rng.random() < 0.5 else 1.0
        direction = {name: sign * value for name, value in cause.typical.items()}
    shape = {name: float(low * (high / low) ** rng.random()) for name, (low, high) in cause.shape.items()}
    return Drawn(cause, direction, shape, cause.places[rng.integers(len(cause.places))])


def _effect(name: str, knob: str, typical: float, unit: str, *places: tuple[str, ...], about: str, **rest) -> Cause:
    return Cause(name, {knob: typical}, unit, places, about, **rest)


LIBRARY = (
    _effect("contact_patch_lag", "sigma_c", 0.05, "m", ROLLING, about="slip angle lags over a travelled length"),
    _effect("delay", "tau_d", 4e-3, "s", ROLLING, about="force channel is late"),
    _effect("sensor_lowpass", "T_f", 5e-3, "s", ROLLING, about="force channel behind a first-order low-pass"),
    _effect("inertia", "m_b", 5.0, "kg", ROLLING, about="mass between tyre and transducer, -m y''"),
    _effect("second_branch", "c_2", 1.2e4, "N/m", ROLLING, about="second relaxing force",
            shape={"tau_2": (0.015, 0.12)}),
    _effect("springpot", "c_f", 4e3, "N s^a/m", ROLLING, about="fractional force c D^a y", shape={"a_f": (0.18, 0.4)}),
    _effect("dry_friction", "F_d", 30.0, "N", ROLLING, about="Dahl friction of the carcass",
            shape={"delta_d": (1e-3, 4e-3)}),
    _effect("quadratic_damping", "d_2", 300.0, "N s^2/m^2", ROLLING, about="d y'|y'|"),
    _effect("cubic_stiffness", "k_c", 2.2e7, "N/m^3", ROLLING, ALL, about="k y^3", both_signs=True),
    _effect("payne", "c_P", 1e4, "N/m", ROLLING, ALL, about="c y / (1 + |y| / y_P)", shape={"y_P": (1.5e-3, 6e-3)}),
    _effect("asymmetric_stiffness", "k_a", 1.2e3, "N/m", ROLLING, ALL, about="k |y|", both_signs=True),
    _effect("slip_offset", "alpha_0", 1.4e-3, "rad", SINES, ROLLING, about="toe, ply steer", both_signs=True),
    _effect("force_offset", "F_off", 25.0, "N", SINES, ROLLING, about="zero error", both_signs=True),
    _effect("force_gain", "g_F", 0.02, "1", SINES, about="gain error, not there when calibrated", both_signs=True),
    _effect("cornering_stiffness", "e_alpha", 0.05, "1", SINES, about="another initial slope than in the step tests",
            both_signs=True, most=1.5),
    _effect("friction_level", "e_mu", 0.08, "1", SINES, about="another maximum than in the step tests",
            both_signs=True, most=1.2),
    _effect("carcass_stiffness", "e_y", 0.06, "1", ROLLING, about="another stiffness than in the quasi-static test",
            both_signs=True),
    _effect("speed", "e_v", 0.03, "1", ROLLING, about="true speed differs from the stated one", both_signs=True),
    _effect("steering_compliance", "kappa_s", 1.4e-6, "rad/N", SINES, ROLLING, about="angle minus kappa F"),
    _effect("load_coupling", "kappa_z", 5e-6, "1/N", SINES, ROLLING, about="load times 1 + kappa F", both_signs=True),
    Cause("wheel_order", {"A_wc": 14.0, "A_ws": 14.0}, "N", (ROLLING,), "force variation, once per turn of the wheel"),
    Cause("drum_runout", {"m_dc": 5.7e-3, "m_ds": 5.7e-3}, "1", (ROLLING,), "load modulated once per turn of the drum"),
    _effect("drift", "k_t", -4.5e-5, "1/s", SINES, about="gain changes over the day of the sines", both_signs=True),
    _effect("warm_up", "w_t", 0.02, "1", ROLLING, about="gain fades within a run", shape={"tau_t": (1.5, 6.0)},
            both_signs=True),
    _effect("backlash", "b_0", 5e-4, "rad", SINES, ROLLING, about="play between angle transducer and wheel"),
)  # fmt: skip

#: laws of the diagnosis' library that no campaign hides: what a hidden effect may be taken for
RIVALS = (
    _effect(
        "graded_play", "b_g", 5e-4, "rad", SINES, ROLLING, about="plays of a third, one and five thirds of a width"
    ),
)

VARIANTS = (
    Cause("finite_brush", {"L_patch": 0.15}, "m", (ROLLING,), "bristles fill while they pass the patch (lag L/3)",
          alias="contact_patch_lag"),
    Cause("second_order_filter", {"T_second": 5e-3}, "s", (ROLLING,), "force channel behind a Butterworth filter",
          alias="sensor_lowpass"),
    Cause("stribeck_friction", {"F_d": 30.0}, "N", (ROLLING,), "friction that falls with speed (LuGre, undamped)",
          shape={"delta_d": (1e-3, 4e-3), "a_stribeck": (0.3, 0.8), "v_stribeck": (0.03, 0.15)}, alias="dry_friction"),
)  # fmt: skip

_TURN = {"phase": (0.01, 2 * np.pi)}

UNMODELLED = (
    Cause("rig_resonance", {"q_rig": 0.03}, "1", (ROLLING,), "mode of the rig at 5 to 7 Hz in the force path",
          shape={"f_rig": (5.0, 7.0), "z_rig": (0.02, 0.06)}),
    Cause("gear_mesh", {"A_gear": 8.0}, "N", (ROLLING,), "a steady line near 7 Hz, on the rig's own clock",
          shape={"f_gear": (6.7, 7.8), **_TURN}),
    Cause("aliased_hum", {"A_hum": 8.0}, "N", (ROLLING,), "an inverter's line at 61 to 64 Hz, aliased",
          shape={"f_hum": (61.2, 63.8), **_TURN}),
    Cause("amplifier_knee", {"g_knee": 0.06}, "1", (SINES,), "gain falls beyond 1.3 kN"),
    Cause("dead_band", {"b_dead": 15.0}, "N", (SINES,), "nothing recorded around zero"),
    Cause("turning_gain", {"g_rate": 0.01}, "1", (SINES,), "gain depends on the direction of the steer"),
    Cause("steer_harmonic", {"a_second": 1e-3}, "rad", (SINES,), "second harmonic in the steer that the record lacks",
          shape=_TURN),
    Cause("reversal_ringing", {"A_ring": 20.0}, "N", (SINES,), "decaying 14 to 20 Hz after each reversal of the steer",
          shape={"f_ring": (14.0, 20.0)}),
    Cause("subharmonic", {"A_half": 8.0}, "N", (SINES,), "line at half the steer's frequency", shape=_TURN),
    Cause("bump_stop", {"k_bump": 5e3}, "N/m", (ROLLING,), "the carcass meets a stop on one side from 6 mm"),
    Cause("encoder_cycle", {"e_cyclic": 2e-4}, "rad", (SINES,), "cyclic error of the angle encoder", shape=_TURN),
    Cause("tread_heating", {"h_heat": 0.03}, "1", (SINES,), "slope falls with sliding power, and recovers in 1 to 3 s",
          shape={"tau_heat": (0.6, 2.0)}),
)  # fmt: skip

BY_NAME = {cause.name: cause for cause in (*LIBRARY, *VARIANTS, *UNMODELLED)}


def table() -> str:
    """All causes as Markdown."""
    lines = ["| cause | kind | knob, typical size | acts in | what it is |", "|---|---|---|---|---|"]
    for kind, group in (("in-library", LIBRARY), ("variant", VARIANTS), ("unmodelled", UNMODELLED)):
        for c in group:
            sizes = ", ".join(f"{name} {value:g}" for name, value in c.typical.items())
            places = " or ".join(", ".join(place) for place in c.places)
            label = f"{kind} of {c.alias}" if c.alias else kind
            lines.append(f"| {c.name} | {label} | {sizes} {c.unit} | {places} | {c.about} |")
    return "\n".join(lines)
