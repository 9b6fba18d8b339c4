"""Do intervals hold the truth under coloured noise? Writes reports/records/coloured_noise.md.

    python scripts/studies/coloured_noise.py [--campaigns 200] [--pooled 200] [--first 0] [--parallel 2]
                                            [--work FOLDER] [--page FILE]

A damper with one Maxwell branch is driven by two chirps and two random records of 10 s at 200 Hz; no record repeats.
The force is integrated here, exactly for a stroke that is linear over a twentieth of a sample, and shares no code
with mofit. Every second campaign has autoregressive noise of order 1 with the coefficient 0.8, the others 1/f noise
(Kasdin's filter, begun 2,000 samples before the record); its standard deviation is 2 % of the range. Each record has
an offset of its own, drawn from a normal of 20 N. Each campaign is identified and sampled twice, with free and with
pooled offsets. Counted is how often the 90 % interval holds the truth; of the offsets, the normal interval of estimate
and standard deviation. Of a normal whose mean and spread are estimated from four values, the truth is 0 N and 20 N.
Long memory became part of the noise model after pilot runs of the seeds 0 to 23, and its largest exponent after 200
campaigns from seed 1000, whose intervals held 81 to 88 % under 1/f noise: the spectrum had been too low on the slowest
lines. Rows that the work folder holds are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.mode_sampling import sample_modes
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import find_model
from mofit.problem.scoped_estimates import scoped_estimates
from mofit.runtime.parallel import end_with_parent
from mofit.sampling import laplace_covariance
from report_page import ROOT, header, made_with, table

TRUTH = {"c": 2e4, "d": 400.0, "c_M": 3e4, "d_M": 600.0}
RATE, SECONDS, FINE = 200.0, 10.0, 20
LEVEL, OFFSET, BEFORE = 0.02, 20.0, 2000
NOISES, OFFSETS = ("AR(0.8)", "1/f"), ("free", "pooled")


def force(x: FloatArray, v: FloatArray, step: float) -> FloatArray:
    """Force of spring, damper and Maxwell branch; the branch exactly for a stroke that is linear between samples."""
    rate = TRUTH["c_M"] / TRUTH["d_M"]
    decay, branch = np.exp(-rate * step), np.empty(len(x))
    branch[0] = x[0]
    for k, slope in enumerate(np.diff(x) / step):
        lag = slope / rate
        branch[k + 1] = x[k] + slope * step - lag + (branch[k] - x[k] + lag) * decay
    return TRUTH["c"] * x + TRUTH["d"] * v + TRUTH["c_M"] * (x - branch)


def noise(rng: np.random.Generator, count: int, kind: str) -> FloatArray:
    """Noise of unit standard deviation."""
    white = rng.normal(size=count + BEFORE)
    if kind == "AR(0.8)":
        values = lfilter([1.0], [1.0, -0.8], white)
    else:
        steps = np.arange(1, count + BEFORE)
        values = np.convolve(white, np.cumprod(np.concatenate([[1.0], (steps - 0.5) / steps])))[: count + BEFORE]
    values = values[BEFORE:]
    return np.asarray(values / np.sqrt(np.mean(values**2)))


def strokes(rng: np.random.Generator, time: FloatArray) -> list[tuple[str, FloatArray, FloatArray]]:
    """Kind, stroke and its rate of every record."""
    found = []
    for amplitude, low, high in ((4e-3, 0.3, 12.0), (2e-3, 8.0, 0.5)):
        phase = 2 * np.pi * (low * time + (high - low) * time**2 / 2 / SECONDS)
        speed = 2 * np.pi * (low + (high - low) * time / SECONDS)
        found.append(("chirp", amplitude * np.sin(phase), amplitude * np.cos(phase) * speed))
    for _ in range(2):
        frequencies = np.arange(1, 120) * 0.1 * (1 + 1e-3 * np.pi)
        phases = 2 * np.pi * frequencies[:, None] * time + rng.uniform(0, 2 * np.pi, 119)[:, None]
        size = 1 / (1 + (frequencies / 3) ** 2)
        x, v = size @ np.sin(phases), (size * 2 * np.pi * frequencies) @ np.cos(phases)
        found.append(("free", 3e-3 * x / np.abs(x).max(), 3e-3 * v / np.abs(x).max()))
    return found


def campaign(seed: int) -> tuple[Campaign, FloatArray]:
    """One campaign, and the true offsets of its records."""
    rng, kind = np.random.default_rng([seed, 7]), NOISES[seed % 2]
    count = int(RATE * SECONDS)
    fine = np.arange(count * FINE) / RATE / FINE
    measurements, offsets = [], rng.normal(0.0, OFFSET, 4)
    for k, (procedure, x, v) in enumerate(strokes(rng, fine)):
        clean = force(x, v, fine[1])[::FINE]
        values = clean + offsets[k] + LEVEL * np.ptp(clean) * noise(rng, count, kind)
        inputs = {"displacement": x[::FINE]}
        experiment = Experiment(f"{procedure} {k + 1}", procedure, np.arange(count) / RATE, inputs, {})
        measurements.append(Measurement(experiment, {"force": values}, {"displacement": "m", "force": "N"}))
    return Campaign("damper with coloured noise", "simulated", {}, tuple(measurements)), offsets


def row(task: tuple[int, str], work: Path) -> dict[str, object]:
    """One identification: whether its intervals hold the truth; kept in the work folder."""
    seed, how = task
    path = work / f"{seed}-{how}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    data, offsets = campaign(seed)
    pooled = {"pooled": ("F_0",)} if how == "pooled" else {"scopes": {"F_0": "test"}}
    settings = Settings(fixed={"p": 0.0}, evaluations=200, jobs=1, seed=seed, **pooled)
    found = locate_minima(data, find_model("maxwell_damper"), settings)
    modes = sample_modes(adjusted_modes(found.posterior, found.minima, settings), settings)
    space, best = found.posterior.space, modes[0]
    draws = space.from_unit(best.chains.thinned().points.reshape(-1, len(space)))
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    truth = {**TRUTH, "F_0_mean": 0.0, "F_0_spread": OFFSET}
    inside = {name: bool(low[k] <= truth[name] <= high[k]) for k, name in enumerate(space.names)}
    estimates = scoped_estimates(found.problem, best.minimum.point, laplace_covariance(best.minimum.hessian))
    assert estimates is not None
    off = (estimates.values[:, 0] - offsets) / estimates.sd[:, 0]
    result = {
        "noise": NOISES[seed % 2], "offsets": how, "inside": inside, "converged": best.chains.converged,
        "offset_inside": [bool(abs(z) < 1.645) for z in off],
    }  # fmt: skip
    path.write_text(json.dumps(result), encoding="utf-8")
    return result


def page(rows: list[dict[str, object]], command: str) -> str:
    """Coverage by noise, way with the offsets and parameter."""
    names = (*TRUTH, "F_0_mean", "F_0_spread")
    lines, body = header("Intervals under coloured noise", __doc__, command), []
    for kind in NOISES:
        for how in OFFSETS:
            own = [one for one in rows if (one["noise"], one["offsets"]) == (kind, how)]
            cells = [_share([one["inside"][name] for one in own if name in one["inside"]]) for name in names]  # type: ignore[index,operator]
            each = _share([value for one in own for value in one["offset_inside"]])  # type: ignore[attr-defined]
            mixed = sum(not one["converged"] for one in own)
            body.append((kind, how, len(own), *cells, each, mixed))
    every = [one["inside"][name] for one in rows for name in TRUTH]  # type: ignore[index]
    lines += [f"The 90 % intervals of {', '.join(TRUTH)} hold the truth in {_share(every)} of all cases.", ""]
    lines += table(("noise", "offsets", "campaigns", *names, "offset of a record", "not converged"), body)
    return "\n".join([*lines, made_with()]) + "\n"


def _share(held: list[bool]) -> str:
    return f"{100 * np.mean(held):.1f} %" if held else "–"


def main() -> None:
    """Run all and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--campaigns", type=int, default=200)
    parser.add_argument("--pooled", type=int, default=200, help="campaigns with pooled offsets too")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "coloured_noise")
    parser.add_argument("--page", type=Path, default=ROOT / "reports" / "records" / "coloured_noise.md")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    counts = dict(zip(OFFSETS, (args.campaigns, args.pooled), strict=True))
    tasks = [(args.first + k, how) for k in range(max(counts.values())) for how in OFFSETS if k < counts[how]]
    with ProcessPoolExecutor(args.parallel, initializer=end_with_parent) as pool:
        rows = list(pool.map(partial(row, work=args.work), tasks))
    command = f"coloured_noise.py --campaigns {args.campaigns} --pooled {args.pooled} --first {args.first}"
    text = page(rows, command)
    args.page.parent.mkdir(parents=True, exist_ok=True)
    args.page.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
