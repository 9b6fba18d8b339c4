"""What may hide in a rig: effects of the catalogue, laws of their own, strangers, parts that rotate unobserved."""

from __future__ import annotations

from dataclasses import dataclass

from other_rigs_cases.excitation import KINDS
from other_rigs_cases.mechanics import DAMPER, JOINT, OSCILLATOR, STRUCTURE
from other_rigs_cases.tyre import TYRE

RIGS = {rig.name: rig for rig in (TYRE, JOINT, DAMPER, STRUCTURE, OSCILLATOR)}
ALL, DRIVEN = tuple(RIGS), ("tyre", "damper")
NOISES = ("white", "AR(0.8)", "1/f")


@dataclass(frozen=True)
class Case:
    """A cause; its knob is about its share of the rig's force, or a time or an angle in units of the rig."""

    name: str
    kind: str
    """``none``, ``library``, ``own law``, ``stranger`` or ``no encoder``."""
    knob: str = ""
    family: str = ""
    effect: str = ""
    """The effect of the catalogue that it is."""
    most: float = 1.0
    """Largest value of the knob."""
    rigs: tuple[str, ...] = ALL
    excitations: tuple[str, ...] = KINDS
    akin: str = ""
    """Family to which a stranger belongs in a wider sense: naming it is no mistake."""


CASES = (
    Case("none", "none"),
    Case("dry friction", "library", "dahl", "friction", "dry_friction"),
    Case("cubic stiffness", "library", "cubic", "non-linear stiffness", "cubic_stiffness"),
    Case("asymmetric stiffness", "library", "asymmetric", "non-linear stiffness", "asymmetric_stiffness", 0.5),
    Case("quadratic damping", "library", "quadratic", "non-linear damping", "quadratic_damping", 2.0),
    Case("second branch", "library", "branch", "relaxation", "second_branch"),
    Case("delay", "library", "delay", "lag or delay", "delay", 0.4),
    Case("sensor low-pass", "library", "lowpass", "lag or delay", "sensor_lowpass", 0.4),
    Case("drift", "library", "drift", "drift", "drift", 0.4),
    Case("play", "library", "play", "play", "backlash", 0.06, DRIVEN),
    Case("wheel order", "library", "wheel_order", "non-uniformity of rotating parts", "wheel_order", 0.3, ("tyre",)),
    Case("Stribeck friction", "own law", "stribeck", "friction"),
    Case("sinh spring", "own law", "sinh", "non-linear stiffness"),
    Case("damping of power 1.5", "own law", "power", "non-linear damping", most=2.0),
    Case("load-dependent lag", "own law", "load_lag", "lag or delay", most=0.4),
    Case("Butterworth filter of order 2", "own law", "butterworth_2", "lag or delay", most=0.4),
    Case("Butterworth filter of order 3", "own law", "butterworth_3", "lag or delay", most=0.3),
    Case("broad relaxation spectrum", "own law", "broad", "relaxation"),
    Case("saturating drift", "own law", "saturating_drift", "drift", most=0.4),
    Case("drift of the stiffness", "own law", "force_drift", "drift", most=0.4),
    Case("damper that warms", "own law", "warm_damper", "drift", most=0.8),
    Case("play with hysteresis", "own law", "hysteretic_play", "play", most=0.05, rigs=DRIVEN),
    Case("bump stop", "stranger", "bump", akin="non-linear stiffness"),
    Case("amplifier knee", "stranger", "knee", most=0.6),
    Case("dead band", "stranger", "dead_band", most=0.2),
    Case("gain that walks", "stranger", "gain_walk", most=0.5, akin="drift"),
    Case("subharmonic", "stranger", "subharmonic", most=0.3, excitations=("sine", "chirp")),
    Case("wheel order", "no encoder", "wheel_order", "non-uniformity of rotating parts", "wheel_order", 0.3, ("tyre",)),
    Case("drum order", "no encoder", "drum", "non-uniformity of rotating parts", "drum_runout", 0.3, ("tyre",)),
    Case("damping that grows with the deflection", "stranger", "film", most=2.0, akin="non-linear damping"),
    Case("one-sided gain", "stranger", "one_sided", most=0.6),
    Case("rectified crosstalk of the drive", "stranger", "crosstalk", most=0.3),
    Case(
        "shaft order",
        "no encoder",
        "wheel_order",
        "non-uniformity of rotating parts",
        "shaft_order",
        0.3,
        ("joint", "damper", "structure", "oscillator"),
    ),
)


@dataclass(frozen=True)
class Cell:
    """One campaign to make: rig, excitation, noise, case and its number."""

    rig: str
    excitation: str
    noise: str
    case: int
    repeat: int

    @property
    def numbers(self) -> tuple[int, ...]:
        """Entropy of its random numbers."""
        kinds = (ALL.index(self.rig), KINDS.index(self.excitation), NOISES.index(self.noise))
        return (*kinds, self.case, self.repeat)


def cells(each: int, none: int) -> list[Cell]:
    """Every combination that exists, ``each`` times; ``none`` times without an effect."""
    return [
        Cell(rig, excitation, noise, k, repeat)
        for k, case in enumerate(CASES)
        for repeat in range(each if case.knob else none)
        for rig in case.rigs
        for excitation in case.excitations
        for noise in NOISES
    ]
