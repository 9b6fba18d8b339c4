"""Do intervals hold the truth as often as they say? Writes reports/calibration/.

    python scripts/calibration.py [--campaigns 300] [--jobs 2] [--work FOLDER]

Simulation-based calibration (Talts et al. 2018): parameters are drawn from the prior, a campaign is simulated in closed
form (no code of the model under test), the parameters are identified as `mofit identify` does (search, refinement,
sampling), and it is noted where the truth lies among the posterior's draws. One mode: a damper with a Maxwell branch on
four sine tests. Two modes: an inclined spring whose sign is next to invisible; the draws of both modes are mixed by
their weights. Noise: white, autoregressive with coefficient 0.8, and growing with the force. Rows that the work folder
holds already are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import binom, chi2, norm

from mofit.campaign import Campaign, Measurement, Procedure
from mofit.identify import sampled_modes
from mofit.model import Channel, Equations, Model
from mofit.parameters import Parameter, ParameterSpace
from mofit.settings import Settings
from report_header import header, versions

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
NOISES = ("white", "autoregressive", "level")
LEVELS = (0.5, 0.8, 0.9, 0.95)
DRAWS, BINS = 99, 20
#: Departure from the nominal coverage that is asked for.
ASKED = 0.03
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
            rates={"x_M": branch / s.d_M},
            initial={"x_M": s.displacement},
        )

    @classmethod
    def force(cls, truth: Array, time: Array, frequency: float) -> Array:
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
    def force(cls, truth: Array, time: Array, frequency: float) -> Array:
        """The spring's law."""
        stiffness, phi = truth
        x = cls.amplitude * np.sin(2 * np.pi * frequency * time)
        return stiffness * x + 2.0 * phi**2 * x**3 + 0.002 * phi * x**2


CASES = {"one mode": Damper, "two modes": InclinedSpring}


def noise(kind: str, force: Array, rng: np.random.Generator) -> Array:
    """Noise of standard deviation NOISE times the range of the force, on average."""
    size = NOISE * np.ptp(force)
    fresh = rng.normal(size=len(force) + 200)
    if kind == "autoregressive":
        return size * 0.6 * lfilter([1.0], [1.0, -0.8], fresh)[200:]
    if kind == "level":
        share = 0.3 + np.abs(force) / np.max(np.abs(force))
        return size * share / np.sqrt(np.mean(share**2)) * fresh[200:]
    return size * fresh[200:]


def campaign(model: type, truth: Array, kind: str, rng: np.random.Generator) -> Campaign:
    """Sine tests of eight periods at 100 Hz."""
    tests = []
    for frequency in model.frequencies:
        time = np.arange(0, 8 / frequency, 0.01)
        x = model.amplitude * np.sin(2 * np.pi * frequency * time)
        force = model.force(truth, time, frequency)
        procedure = Procedure(
            f"sine_{frequency:g}Hz", "sine", time, {"displacement": x}, {}, frequency, model.amplitude
        )
        measured = force + noise(kind, force, rng)
        tests.append(Measurement(procedure, {"force": measured}, {"displacement": "m", "force": "N"}))
    return Campaign("calibration", "simulated", {}, tuple(tests))


def run(case: str, kind: str, work: Path, number: int) -> dict:
    """One campaign: where the truth lies among the draws of each parameter."""
    row = work / f"{case.replace(' ', '_')}-{kind}-{number}.json"
    if row.exists():
        return json.loads(row.read_text())
    rng = np.random.default_rng([number, list(CASES).index(case), NOISES.index(kind)])
    model = CASES[case]()
    space = ParameterSpace(model.parameters)
    unit = rng.random(len(space))
    truth = space.from_unit(unit[None])[0]
    modes = sampled_modes(campaign(type(model), truth, kind, rng), model, Settings(seed=number, jobs=1))
    draws = []
    for mode in modes:
        points = mode.chains.thinned().points.reshape(-1, len(space))
        draws.append(points[rng.integers(len(points), size=round(20_000 * mode.weight))])
    mixed = np.concatenate(draws)
    few = mixed[rng.integers(len(mixed), size=DRAWS)]
    found = {
        "truth": truth.tolist(),
        "place": np.mean(mixed < unit, axis=0).tolist(),
        "rank": np.sum(few < unit, axis=0).tolist(),
        "modes": len(modes),
        "converged": all(mode.chains.converged for mode in modes),
    }
    row.write_text(json.dumps(found))
    return found


def covered(place: Array) -> Array:
    """Whether central intervals hold the truth, (campaign, parameter, level), from its place among the draws."""
    return np.stack([np.abs(place - 0.5) <= level / 2 for level in LEVELS], axis=-1)


def coverage(rows: list[dict]) -> Array:
    """Share of campaigns whose central intervals hold the truth, (parameter, level)."""
    return np.mean(covered(np.array([row["place"] for row in rows])), axis=0)


def reference(case: str, kind: str, number: int) -> Array:
    r"""Place of the truth for the linearised least-squares estimate with the true noise covariance, (parameter,).

    Its error :math:`H^{-1} D^T W e` is Gaussian with covariance :math:`H^{-1} D^T W C W D H^{-1}` exactly, so that it
    covers as it should on average, and by chance more or less on the campaigns at hand: a control variate.
    """
    model = CASES[case]()
    space = ParameterSpace(model.parameters)
    rng = np.random.default_rng([number, list(CASES).index(case), NOISES.index(kind)])
    unit = rng.random(len(space))
    truth = space.from_unit(unit[None])[0]
    normal, slope, scatter = (np.zeros((len(space),) * order) for order in (2, 1, 2))
    steps = 1e-6 * np.eye(len(space))
    for test in campaign(type(model), truth, kind, rng).measurements:
        time, frequency = test.time, test.procedure.frequency
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


def spread_noise(kind: str, force: Array) -> Array:
    """Covariance of `noise`, (n, n)."""
    variance = (NOISE * np.ptp(force)) ** 2
    if kind == "autoregressive":
        return variance * toeplitz(0.8 ** np.arange(len(force)))
    share = 0.3 + np.abs(force) / np.max(np.abs(force)) if kind == "level" else np.ones(len(force))
    return variance * np.diag(share**2 / np.mean(share**2))


def without_chance(rows: list[dict], places: Array) -> tuple[Array, Array]:
    """Coverage with the chance of these campaigns taken off, and its standard error, (parameter, level) each."""
    ours, theirs = covered(np.array([row["place"] for row in rows])).astype(float), covered(places).astype(float)
    mean = theirs.mean(axis=0)
    share = np.mean((ours - ours.mean(axis=0)) * (theirs - mean), axis=0) / np.maximum(theirs.var(axis=0), 1e-12)
    left = ours - share * (theirs - np.array(LEVELS))
    return left.mean(axis=0), left.std(axis=0) / np.sqrt(len(rows))


def uniformity(rows: list[dict]) -> Array:
    """p value of a chi-square test of the ranks of every parameter."""
    ranks = np.array([row["rank"] for row in rows])
    values = []
    for column in ranks.T:
        counts = np.bincount(column * BINS // (DRAWS + 1), minlength=BINS)
        values.append(chi2.sf(np.sum((counts - len(rows) / BINS) ** 2) / (len(rows) / BINS), BINS - 1))
    return np.array(values)


def draw(results: dict, folder: Path) -> None:
    """Rank histograms with the band of 99 % of chance."""
    width = max(len(case.parameters) for case in CASES.values())
    figure, axes = plt.subplots(len(results), width, figsize=(2.6 * width, 1.7 * len(results)), layout="constrained")
    for row, ((case, kind), rows) in enumerate(results.items()):
        low, high = binom.ppf((0.005, 0.995), len(rows), 1 / BINS)
        ranks = np.array([entry["rank"] for entry in rows])
        for column, spot in enumerate(axes[row]):
            if column >= ranks.shape[1]:
                spot.set_axis_off()
                continue
            spot.hist(ranks[:, column], bins=BINS, range=(-0.5, DRAWS + 0.5), color="#0072B2")
            spot.axhspan(low, high, color="#8c959f", alpha=0.3)
            spot.set(xticks=[], yticks=[])
            spot.set_title(f"{CASES[case].parameters[column].name}: {case}, {kind}", fontsize=8)
    figure.savefig(folder / "ranks.png", dpi=110)
    plt.close(figure)


def page(results: dict, arguments: argparse.Namespace) -> str:
    """The tables as Markdown."""
    head = ["campaigns", "parameter", *(f"{100 * level:g} %" for level in LEVELS)]
    head += [f"{100 * level:g} %, chance taken off" for level in LEVELS] + ["p of ranks", "converged"]
    errors = ", ".join(f"{100 * np.sqrt(v * (1 - v) / arguments.campaigns):.1f}" for v in LEVELS)
    note = (
        f"Coverage in % of the central intervals; its standard error is {errors} points at the four levels. "
        f"p: chi-square test of the ranks in {BINS} bins. Chance taken off: minus what the linearised estimate with "
        "the true noise covariance, which covers exactly on average, covers too much or too little on the same "
        "campaigns (control variate), with the standard error that is left."
    )
    lines = [
        *header("Calibration of the posterior", __doc__, f"calibration.py --campaigns {arguments.campaigns}", note),
        f"| {' | '.join(head)} |",
        "|---" * len(head) + "|",
    ]
    every, raw, adjusted = [], [], []
    for (case, kind), rows in results.items():
        shares, p = coverage(rows), uniformity(rows)
        places = np.array([reference(case, kind, number) for number in range(len(rows))])
        pure, error = without_chance(rows, places)
        raw.append(shares - LEVELS)
        adjusted.append(pure - LEVELS)
        every.extend(p)
        sure = 100 * np.mean([row["converged"] for row in rows])
        for k, parameter in enumerate(CASES[case].parameters):
            cells = [f"{case}, {kind}, {len(rows)}", parameter.name, *(f"{100 * v:.1f}" for v in shares[k])]
            cells += [f"{100 * v:.1f} ± {100 * e:.1f}" for v, e in zip(pure[k], error[k], strict=True)]
            lines.append(f"| {' | '.join([*cells, f'{p[k]:.3f}', f'{sure:.0f} %'])} |")
    ordered = np.sort(every)
    corrected = float(np.min(ordered * len(ordered) / np.arange(1, len(ordered) + 1)))
    lines += [
        "",
        f"Smallest p: {ordered[0]:.4f} of {len(ordered)}; after Holm's correction "
        f"{min(1.0, ordered[0] * len(ordered)):.3f}, "
        f"after Benjamini and Hochberg's {min(1.0, corrected):.3f}.",
        "",
        *(
            _within(name, np.concatenate(found))
            for name, found in (("as counted", raw), ("chance taken off", adjusted))
        ),
        "",
        "![Ranks of the truth among the draws; grey: 99 % of chance](ranks.png)",
        "",
    ]
    return "\n".join([*lines, versions(), ""])


def _within(name: str, off: Array) -> str:
    count = int(np.sum(np.abs(off) <= ASKED))
    return (
        f"Coverage {name}: {count} of {off.size} within {100 * ASKED:g} points; on average {100 * off.mean():+.1f}, "
        f"farthest {100 * off.ravel()[np.argmax(np.abs(off))]:+.1f}.\n"
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=300, help="of every kind")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "calibration")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    results = {}
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for case in CASES:
            for kind in NOISES:
                single = partial(run, case, kind, arguments.work)
                results[case, kind] = list(pool.map(single, range(arguments.campaigns), chunksize=5))
                print(case, kind, np.round(100 * coverage(results[case, kind]), 1).tolist(), flush=True)
    target = ROOT / "reports" / "calibration"
    target.mkdir(parents=True, exist_ok=True)
    draw(results, target)
    text = page(results, arguments)
    (target / "README.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
