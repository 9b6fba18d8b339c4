"""What the calibration study simulates, in closed form, and an estimate of it whose coverage is exact."""

from __future__ import annotations

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import norm

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter, ParameterSpace

NOISES = ("white", "autoregressive", "level")
#: Standard deviation of the noise as a share of the force's range.
NOISE = 0.02


class Damper(Model):
    """F = c x + d v + c_M (x - x_M), d_M x_M' = c_M (x - x_M)."""

    name = "sbc_damper"
    parameters = (
        Parameter("c", "N/m", 5e3, 5e4, 2e4, "log"),
        Parameter("d", "N s/m", 1e2, 2e3, 5e2, "log"),
        Parameter("c_M", "N/m", 5e3, 5e4, 2e4, "log"),
        Parameter("d_M", "N s/m", 3e2, 6e3, 1e3, "log"),
    )
    states = (Channel("x_M", "m"),)
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)
    frequencies, amplitude = (0.7, 1.5, 3.0, 6.0), 0.02

    def equations(self, s):
        """One state."""
        branch = s.c_M * (s.displacement - s.x_M)
        return Equations(
            outputs={"force": s.c * s.displacement + s.d * s.velocity + branch},
            derivatives={"x_M": branch / s.d_M},
            initial={"x_M": s.displacement},
        )

    @classmethod
    def force(cls, truth: FloatArray, time: FloatArray, frequency: float) -> FloatArray:
        """Closed form, from rest: the branch's stretch z obeys z' + z / tau = x', z(0) = 0."""
        c, d, c_m, d_m = truth
        w, tau = 2 * np.pi * frequency, d_m / c_m
        s, k = np.sin(w * time), np.cos(w * time)
        stretch = cls.amplitude * w * tau / (1 + (w * tau) ** 2) * (w * tau * s + k - np.exp(-time / tau))
        return c * cls.amplitude * s + d * cls.amplitude * w * k + c_m * stretch


class InclinedSpring(Model):
    """F = k x + h phi^2 x^3 + e phi x^2: the sign of phi is next to invisible."""

    name = "sbc_spring"
    parameters = (Parameter("k", "N/m", 0.5, 2.0, 1.0), Parameter("phi", "rad", -1.0, 1.0, 0.1))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)
    frequencies, amplitude = (0.7, 1.5, 3.0), 1.0

    def equations(self, s):
        """No state."""
        x = s.displacement
        return Equations(outputs={"force": s.k * x + 2.0 * s.phi**2 * x**3 + 0.002 * s.phi * x**2})

    @classmethod
    def force(cls, truth: FloatArray, time: FloatArray, frequency: float) -> FloatArray:
        """The spring's law."""
        stiffness, phi = truth
        x = cls.amplitude * np.sin(2 * np.pi * frequency * time)
        return stiffness * x + 2.0 * phi**2 * x**3 + 0.002 * phi * x**2


CASES = {"one mode": Damper, "two modes": InclinedSpring}


def noise(kind: str, force: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Noise of standard deviation NOISE times the range of the force, on average."""
    size = NOISE * np.ptp(force)
    fresh = rng.normal(size=len(force) + 200)
    if kind == "autoregressive":
        return size * 0.6 * lfilter([1.0], [1.0, -0.8], fresh)[200:]
    if kind == "level":
        share = 0.3 + np.abs(force) / np.max(np.abs(force))
        return size * share / np.sqrt(np.mean(share**2)) * fresh[200:]
    return size * fresh[200:]


def campaign(model: type, truth: FloatArray, kind: str, rng: np.random.Generator) -> Campaign:
    """Sine tests of eight periods at 100 Hz."""
    tests = []
    for frequency in model.frequencies:
        time = np.arange(0, 8 / frequency, 0.01)
        x = model.amplitude * np.sin(2 * np.pi * frequency * time)
        force = model.force(truth, time, frequency)
        experiment = Experiment(
            f"sine_{frequency:g}Hz", "sine", time, {"displacement": x}, {}, frequency, model.amplitude
        )
        measured = force + noise(kind, force, rng)
        tests.append(Measurement(experiment, {"force": measured}, {"displacement": "m", "force": "N"}))
    return Campaign("calibration", "simulated", {}, tuple(tests))


def draw_campaign(
    case: str, kind: str, number: int
) -> tuple[Model, FloatArray, FloatArray, Campaign, np.random.Generator]:
    """Model, truth drawn from the prior (in the unit cube and in SI units), campaign, and the generator for more."""
    rng = np.random.default_rng([number, list(CASES).index(case), NOISES.index(kind)])
    model = CASES[case]()
    space = ParameterSpace(model.parameters)
    unit = rng.random(len(space))
    truth = space.from_unit(unit[None])[0]
    return model, unit, truth, campaign(type(model), truth, kind, rng), rng


def reference(case: str, kind: str, number: int) -> FloatArray:
    r"""Place of the truth for the linearised least-squares estimate with the true noise covariance, (parameter,).

    Its error :math:`H^{-1} D^T W e` is Gaussian with covariance :math:`H^{-1} D^T W C W D H^{-1}` exactly, so that it
    covers as it should on average, and by chance more or less on the campaigns at hand: a control variate.
    """
    model, unit, truth, drawn, _ = draw_campaign(case, kind, number)
    space = ParameterSpace(model.parameters)
    normal, slope, scatter = (np.zeros((len(space),) * order) for order in (2, 1, 2))
    steps = 1e-6 * np.eye(len(space))
    for test in drawn.measurements:
        time, frequency = test.time, test.experiment.frequency
        force = model.force(truth, time, frequency)
        ends = (
            (model.force(space.from_unit((unit + s)[None])[0], time, frequency) for s in sign * steps)
            for sign in (1, -1)
        )
        judged = time > 1 / frequency - 1e-9
        design = np.stack([(above - below) / 2e-6 for above, below in zip(*ends, strict=True)], axis=1)[judged]
        error = (test.channel("force") - force)[judged]
        weight = 1 / np.ptp(force) ** 2
        normal += weight * design.T @ design
        slope += weight * design.T @ error
        scatter += weight**2 * design.T @ spread_noise(kind, force)[np.ix_(judged, judged)] @ design
    inverse = np.linalg.inv(normal)
    return np.asarray(norm.cdf(inverse @ slope / np.sqrt(np.diag(inverse @ scatter @ inverse))))


def spread_noise(kind: str, force: FloatArray) -> FloatArray:
    """Covariance of `noise`, (n, n)."""
    variance = (NOISE * np.ptp(force)) ** 2
    if kind == "autoregressive":
        return variance * toeplitz(0.8 ** np.arange(len(force)))
    share = 0.3 + np.abs(force) / np.max(np.abs(force)) if kind == "level" else np.ones(len(force))
    return variance * np.diag(share**2 / np.mean(share**2))
