"""Forces beside the model's spring: elastic ones, inertia, and relaxation (Maxwell branches, fractional element)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from mofit.models.effect import Addition, Effect
from mofit.models.filters import Washout, derivative, washout_states, washout_time
from mofit.models.model import RECORD_LENGTH, SAMPLE_INTERVAL, Applied, Channel, Symbols
from mofit.parameters import Parameter, powers

#: how stiffnesses, deflections and times grow with the data; a tyre's deflection is not measured
PER_STROKE, STROKE, DURATION = powers(force=1, displacement=-1), powers(displacement=1), powers(time=1)
#: branches of a relaxation spectrum, and of a springpot
BRANCHES = 8
#: relaxation time of a springpot's first branch in sampling intervals, and of its last in lengths of the record
FASTEST, SLOWEST = 0.1, 1.0


def stretches(s: Symbols, states: Sequence[Channel]) -> dict[str, ca.SX]:
    """How far the spring of each branch is deflected [m]: the deflection minus the branch's internal displacement."""
    return {state.name: s.quantities["deflection"] - getattr(s, state.name) for state in states}


def relaxing(s: Symbols, value: ca.SX, stretch: Mapping[str, ca.SX], times: Sequence[ca.SX | float]) -> Applied:
    r"""A force with branches, :math:`\tau_i \dot y_i = y - y_i` with the ``times`` [s], relaxed at the start."""
    return Applied(
        value,
        derivatives={name: left / time for (name, left), time in zip(stretch.items(), times, strict=True)},
        initial=dict.fromkeys(stretch, s.quantities["deflection"]),
    )


class CubicStiffness(Addition):
    r"""Spring force plus :math:`k_c y^3` [N]; positive: hardening.

    Fingerprint: third harmonic, growing with amplitude.
    """

    name = "cubic_stiffness"
    title = "cubic stiffness"
    family = "non-linear stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter(
            "k_c",
            "N/m^3",
            -1e9,
            1e9,
            2.2e7,
            description="cubic stiffness",
            neutral=0.0,
            scales=powers(force=1, displacement=-3),
        ),
    )

    def term(self, s: Symbols) -> ca.SX:
        """Cubic force."""
        return s.k_c * s.quantities["deflection"] ** 3


class AsymmetricStiffness(Addition):
    r"""Spring force plus :math:`k_a |y|` [N]: stiffness :math:`k + k_a` one way, :math:`k - k_a` the other.

    Fingerprint: even harmonics.
    """

    name = "asymmetric_stiffness"
    title = "asymmetric stiffness"
    family = "non-linear stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter("k_a", "N/m", -5e4, 5e4, 1.2e3, description="half the difference", neutral=0.0, scales=PER_STROKE),
    )

    def term(self, s: Symbols) -> ca.SX:
        """Even force."""
        return s.k_a * ca.fabs(s.quantities["deflection"])


class Payne(Addition):
    r"""Spring force plus :math:`c_P y / (1 + |y| / y_P)` [N]: stiffness that is lost beyond a deflection :math:`y_P`.

    The filler network of rubber breaks with strain (Payne, J. Appl. Polym. Sci. 6, 1962). Fingerprint: stiffness that
    falls with amplitude, odd harmonics whatever the frequency.
    """

    name = "payne"
    title = "Payne softening"
    family = "non-linear stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter(
            "c_P",
            "N/m",
            0.0,
            1e5,
            1e4,
            description="stiffness that is lost with amplitude",
            neutral=0.0,
            scales=PER_STROKE,
        ),
        Parameter(
            "y_P",
            "m",
            1e-4,
            0.1,
            3e-3,
            "log",
            "deflection where half of it is lost",
            grid=(1e-3, 3e-3, 1e-2),
            scales=STROKE,
        ),
    )

    def term(self, s: Symbols) -> ca.SX:
        """Softening force."""
        y = s.quantities["deflection"]
        return s.c_P * y / (1 + ca.fabs(y) / s.y_P)


class Inertia(Effect):
    r"""Force minus :math:`m \ddot y` (tyres: belt and tread move with the deflection), or plus (dampers: moved end).

    Fingerprint: odd harmonics, growing with f², in phase with the deflection.
    """

    name = "inertia"
    title = "inertia"
    family = "inertia"
    on = ("lateral_force", "longitudinal_force", "damper_force")
    needs = ("deflection_rate or velocity",)
    parameters = (
        Parameter(
            "m_b",
            "kg",
            0.0,
            100.0,
            5.0,
            description="mass that is accelerated",
            neutral=0.0,
            scales=powers(force=1, displacement=1, velocity=-2),
        ),
    )
    states = washout_states(name, "m/s")
    conditions = (SAMPLE_INTERVAL,)

    #: Share of the sampling interval for the washout: a tyre's acceleration jumps where the slip changes its sign, and
    #: a longer one smears the jump over the next sample.
    washout_share = 0.1

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force with that of the mass."""
        rate = s.quantities.get("deflection_rate")
        chain = Washout(s, self.states, s.velocity if rate is None else rate, washout_time(s, self.washout_share))
        return chain.applied(value + (1 if rate is None else -1) * s.m_b * derivative(chain))


class SecondBranch(Effect):
    r"""Spring force plus :math:`c_2 (y - y_2)` [N] with :math:`\tau_2 \dot y_2 = y - y_2`.

    Fingerprint: odd harmonics, loss largest at :math:`\omega = 1 / \tau_2`.
    """

    name = "second_branch"
    title = "second Maxwell branch"
    family = "relaxation"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter("c_2", "N/m", 0.0, 1e5, 1.2e4, description="stiffness of the branch", neutral=0.0, scales=PER_STROKE),
        Parameter(
            "tau_2",
            "s",
            1e-3,
            10.0,
            0.05,
            "log",
            "relaxation time of the branch",
            grid=(0.01, 0.05, 0.25, 1.0),
            scales=DURATION,
        ),
    )
    states = (Channel("second_branch_displacement", "m", "internal displacement of the branch"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the branch beside it."""
        stretch = stretches(s, self.states)
        return relaxing(s, value + s.c_2 * sum(stretch.values()), stretch, [s.tau_2])


class RelaxationSpectrum(Effect):
    r"""Spring force plus eight Maxwell branches of equal stiffness, their relaxation times evenly spaced in log time.

    .. math::
        \sum_{i=1}^{8} \frac{c_R}{8} (y - y_i), \quad \tau_i \dot y_i = y - y_i, \quad
        \tau_i = \tau_R \, 10^{w_R (\frac{i - 1}{7} - \frac12)}

    A box spectrum (Ferry, "Viscoelastic properties of polymers", 1980): over :math:`w_R` decades the storage
    modulus grows with log frequency and the loss is nearly constant. Few campaigns distinguish it from a springpot or a
    second branch, so a diagnosis tries it only when named.
    """

    name = "relaxation_spectrum"
    title = "relaxation spectrum"
    family = "relaxation"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter(
            "c_R",
            "N/m",
            0.0,
            2e5,
            2e4,
            description="stiffness of all branches together",
            neutral=0.0,
            scales=PER_STROKE,
        ),
        Parameter("tau_R", "s", 1e-3, 10.0, 0.1, "log", "central relaxation time", grid=(0.015, 0.1), scales=DURATION),
        Parameter("w_R", "1", 0.5, 6.0, 3.0, description="width in decades", grid=(2.0, 4.0)),
    )
    states = tuple(Channel(f"relaxation_{i}", "m", f"internal displacement of branch {i}") for i in range(BRANCHES))
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the branches beside it."""
        stretch = stretches(s, self.states)
        times = [s.tau_R * 10 ** (s.w_R * place) for place in np.linspace(-0.5, 0.5, BRANCHES)]
        return relaxing(s, value + s.c_R / BRANCHES * sum(stretch.values()), stretch, times)


class Springpot(Effect):
    r"""Spring force plus :math:`c_f D^a y` [N], :math:`0 < a < 1`: the power-law relaxation of filled rubber.

    The relaxation modulus :math:`c_f t^{-a} / \Gamma(1 - a)` is a continuum of Maxwell branches over the logarithm of
    their relaxation time, here one per :math:`\Delta` (trapezoidal rule), from a tenth of the test's sampling interval
    to its length; those still slower are springs, those still faster are dampers, which the first branch adds to its
    own:

    .. math::
        c_f D^a y \approx \sum_i c_i (y - y_i) + c_\infty y, \quad \tau_i \dot y_i = y - y_i, \quad
        c_i = c_f \frac{\sin \pi a}{\pi} \, \Delta \, \tau_i^{-a}, \quad
        c_\infty = c_f \frac{\sin \pi a}{\pi a} (\tau_8 e^{\Delta / 2})^{-a}

    Within 2 % for a from 0.1 to 0.6, from one period in the record to eight samples per period, for up to
    :math:`10^5` samples. Fingerprint: odd harmonics, the same loss at all f.
    """

    name = "springpot"
    title = "springpot (fractional)"
    family = "relaxation"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter(
            "c_f",
            "N s^a/m",
            0.0,
            1e5,
            4e3,
            description="coefficient of the fractional element",
            neutral=0.0,
            scales=powers(force=1, displacement=-1, time=0.25),
        ),
        Parameter("a_f", "1", 0.05, 0.95, 0.25, description="exponent: 0 a spring, 1 a damper", grid=(0.15, 0.3, 0.5)),
    )
    states = tuple(Channel(f"springpot_{i}", "m", f"internal displacement {i}") for i in range(BRANCHES))
    conditions = (SAMPLE_INTERVAL, RECORD_LENGTH)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the branches beside it."""
        a, stretch = s.a_f, stretches(s, self.states)
        first, last = FASTEST * s.sample_interval, SLOWEST * s.record_length
        width = ca.log(last / first) / (BRANCHES - 1)
        times = [first * ca.exp(i * width) for i in range(BRANCHES)]
        scale = s.c_f * ca.sin(np.pi * a) / np.pi / a
        weights = [a * width * time**-a for time in times]
        weights[0] += a / (1 - a) * (first * ca.exp(-width / 2)) ** (1 - a) / first
        branches = sum(weight * left for weight, left in zip(weights, stretch.values(), strict=True))
        slower = (last * ca.exp(width / 2)) ** -a
        return relaxing(s, value + scale * (branches + slower * s.quantities["deflection"]), stretch, times)
