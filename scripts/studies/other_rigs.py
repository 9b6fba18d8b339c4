"""Is a diagnosis right on rigs of other kinds? Blinded campaigns of five rigs. Writes reports/other_rigs/README.md.

    python scripts/studies/other_rigs.py [--seed 0] [--each 1] [--none 4] [--limit N] [--only TEXT ...]
                                         [--parallel 2] [--time 120] [--work FOLDER] [--page FILE]

A tyre on a drum, a robot joint, a stroked damper, a structure of two modes and an oscillator, with sizes over decades
(dampers from 10 N to 100 kN). Each is integrated here, without code of mofit: Runge-Kutta with six steps per sample,
filters and delays on that grid, laws of their own. Without an effect, from rest and with noise of 0.01 %, every rig
passes for its model. A campaign has four to six sines, chirps, road-like random records or multisines (15 lines, four
periods; of the structure 30, two) of 1000 samples and 20 cycles of the rig's own frequency, with white noise, AR(0.8)
or 1/f noise. Half of the campaigns of sines and multisines begin at rest, half once the rig has settled. The tyre has
three steps and a quasi-static test besides. The model under test is a shipped one (tyre: `maxwell_tyre`; damper:
`kelvin_voigt_damper`; `oscillator`), or a file as a user writes it (joint, structure).

Hidden is nothing; an effect of the catalogue; a cause of the catalogue by a law of its own; a stranger; or, without
encoder, a rotating part at a random angle per test, whose speed half of the other campaigns state, too. Noise is 1 %
of the output's range. The effect is as strong as
makes the root mean square of the gap 3 to 10 times the noise, log-uniform, after a linear refit of all parameters of
the rig; where its largest size stays below that, the noise is lowered instead, at most to 0.01 % of the range. What
does not stand out even so is not counted. `mofit.diagnose` runs in a process of its own with a limit of wall time and
sees neither label nor truth; seconds are its processor time, import, compilation and predictions included.

A play with hysteresis is the mean of three plays. As it, the saturating drift and the load-dependent lag had come out
`unknown` (seeds 62, 70 and 75), the catalogue has a play of distributed width, a drift of the output that settles and a
lag that grows with the load: like them, or the same. What went wrong with seed 78 led to ranges of effects from the
motion, to the memory of the noise told by all tests, and to the order in which several effects are named; with seed
2641 to fits of all effects where none explains most of the gap, and to no gap where a score alone shows one by chance;
with seed 1187 to tests left out that contradict a law each by itself; with seed 2213 to terms that are read along the
motion which the records tell; with seeds 7426 and 8111 to constants that count less where the noise is slow; with seed
10303 to single effects that are fitted again from where several ended, and to fits that go on in curved valleys; with
seed 11549 to fits of all effects before two are named, and to inputs that are led in of all tests that fit better so;
with seed 13007 to noise that is told without bias where past inputs predict all; with seed 13337 to records that do not
repeat and tell the memory of the noise of those that do, and to intervals of records held out that do not take the
spread of tests; with the strangers of all these seeds to causes that must be seen to help, may leave most of a gap
nowhere in the campaign, and are none where they leave much of which a term leaves hardly anything; to terms learnt
without the calibration stages, to a saturation among them and to rates of inputs, and to a residual test of functions
of the model's own signals.

Strangers are no effect of the catalogue: a bump stop, a damping that grows with the deflection, an amplifier's knee, a
dead band, a gain of one sign alone, a rectified crosstalk of the drive, a gain that walks at random, a subharmonic.

Right is: `none` without an effect; the effect as the first one named; the family as the first one named (`group`,
`several` and `partly`: among those named); `unknown` of a stranger. A bump stop is a spring that stiffens with its
stroke, a gain that walks a drift, a damping that grows one that is not linear: whoever names that family says nothing
false, and a row of its own counts it. The gap
is measured against noise-free records that no fit saw: of the same kind and within the amplitudes, a larger one, and of
another kind of excitation; not without encoder, where the angle there is anyone's guess. Rows that the work folder
holds already are kept. `--limit` takes that many campaigns at random; `--only` those that every text fits, of rig,
excitation, noise, case and kind of case, as in `--only tyre "no encoder"`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import mofit
from mofit.runtime.parallel import end_with_parent
from other_rigs_cases.campaign import make, name_of
from other_rigs_cases.cases import CASES, Cell, cells
from other_rigs_cases.page import page
from other_rigs_cases.score import row_of
from report_page import ROOT
from systems.running import limited

CHILD = Path(__file__).parent / "other_rigs_cases" / "diagnosed.py"


def code_digest() -> str:
    """Digest of mofit and of the generator: rows of another code are not kept."""
    digest = hashlib.sha256()
    for folder in (Path(mofit.__file__).parent, CHILD.parent):
        for file in sorted(folder.rglob("*.py")):
            if file.name not in ("page.py", "score.py"):
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def matches(cell: Cell, texts: Sequence[str]) -> bool:
    """Whether every text is one of the cell's."""
    case = CASES[cell.case]
    return {*texts} <= {cell.rig, cell.excitation, cell.noise, case.name, case.kind}


def chosen(every: Sequence[Cell], only: Sequence[str], limit: int | None, seed: int) -> list[Cell]:
    """Cells that match, in random order if some are left out."""
    found = [cell for cell in every if matches(cell, only)]
    if limit is None or limit >= len(found):
        return found
    return [found[k] for k in np.random.default_rng(seed).permutation(len(found))[:limit]]


def run(cell: Cell, seed: int, work: Path, time: float, digest: str) -> dict[str, Any]:
    """Make, diagnose and score one campaign; a row that exists is kept."""
    name = name_of(cell, seed)
    path = work / "rows" / f"{name}-{digest}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    model, folder = make(cell, seed, work), work / "answers" / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "predictions.npz").unlink(missing_ok=True)
    command = [sys.executable, str(CHILD), name, "--work", str(work), "--model", model, "--seed", str(seed)]
    code, _, cpu = limited(command, folder, time)
    row = row_of(work, name, code, cpu)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(row), encoding="utf-8")
    return row


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--each", type=int, default=1, help="campaigns per rig, excitation, noise and case")
    parser.add_argument("--none", type=int, default=4, help="the same without an effect")
    parser.add_argument("--limit", type=int, help="take that many at random")
    parser.add_argument("--only", nargs="*", default=[], help="rig, excitation, noise, case or kind; all must match")
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--time", type=float, default=120.0, help="s of wall time per diagnosis")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "other_rigs")
    parser.add_argument("--page", type=Path, default=ROOT / "reports" / "other_rigs" / "README.md")
    args = parser.parse_args()
    wanted = chosen(cells(args.each, args.none), args.only, args.limit, args.seed)
    limit = "" if args.limit is None else f" --limit {args.limit}"
    only = "".join(f" {text!r}" for text in args.only)
    command = f"other_rigs.py --seed {args.seed} --each {args.each} --none {args.none}{limit} --time {args.time:g}"
    command += f" --only{only}" if only else ""
    one = partial(run, seed=args.seed, work=args.work.resolve(), time=args.time, digest=code_digest())
    args.page.parent.mkdir(parents=True, exist_ok=True)
    rows: dict[Cell, dict[str, Any]] = {}
    with ProcessPoolExecutor(args.parallel, get_context("spawn"), initializer=end_with_parent) as pool:
        tasks = {pool.submit(one, cell): cell for cell in wanted}
        for task in as_completed(tasks):
            row = rows[tasks[task]] = task.result()
            told = (row["rig"], row["excitation"], row["noise"], row["case"], row["verdict"], row["effects"])
            print(row["name"], *told, row["seconds"], flush=True)
            done = [rows[cell] for cell in wanted if cell in rows]
            args.page.write_text(page(done, len(wanted), command, __doc__), encoding="utf-8")


if __name__ == "__main__":
    main()
