"""What do peers say of the gaps that `mofit diagnose` sees? Writes reports/diagnosis_peers/README.md.

    python scripts/studies/diagnosis_peers.py [--seed 0] [--none 5] [--library 8] [--own 6] [--strangers 5]
                                              [--data FOLDER] [--time 300] [--parallel 2] [--work FOLDER]
                                              [--page FILE]

Campaigns of `other_rigs.py` (damper, joint, oscillator; sines, chirps, random records, multisines; white and AR(0.8)
noise), drawn at random by kind, each case at most once more than another; what rotates is left out. `mofit diagnose`
runs as in that study. The peers get the same records and the model with its parameters fitted as `mofit diagnose` fits
them without effects; deflection, rate, input, simulated output and its rates; then the residual of the campaign, to
predict that of records held out. No peer sees label or truth. Settings are chosen by leaving out each test in turn: the
simplest within one standard error of the best, no correction being the simplest; this also decides whether a peer says
that there is a gap. Not given to peers: the time since the campaign began, which a drift would need.

- SINDy (pysindy): powers and moduli of deflection and rate, a sign of the rate, first and second rates of a signal; as
  an addition to the output or as a force beside the input, carried through the model to first order; by thresholded
  least squares or a forward search; the fitted parameters may change along, to first order.
- FROLS (sysidentpy): NFIR or NARX; linear in lagged signals and their shapes, or of degree 3; at most 3 or 10 terms by
  the Bayes criterion; simulated freely on records held out.
- Gaussian process (Kennedy and O'Hagan; scikit-learn): squared-exponential with a length per signal, white noise; 300
  samples for hyperparameters, 900 for predictions; modular, that is after the parameters were fitted.
- LISDD (arXiv 2606.23215), of which only the abstract could be had; in brackets what it leaves open and is chosen here:
  the physics is fitted on a clean regime (bands of deflection and rate, four each, that are not flagged, from the
  quieter half on), discrepant regions are flagged by their residual's energy (F-test, false discovery rate 5 %), a
  sparse local term (the library of SINDy, one or two) is selected by exhaustive holdout and confirmed by an F-test on
  a split sample (blocks of 50 samples in turn). No package of it is known.
- Residual tests: a correlation of residual and past input, or of the residual with itself, outside the 99 % band of the
  largest of 25 lags and all tests. MATLAB's `resid` draws these; it was not run.

The table from terms to families is fixed: |x|, x², |x|x, x³, x⁵: non-linear stiffness; v², |v|v, v³, x²v: non-linear
damping; sign(v): friction; rates, and lagged signals alone: lag or delay; own lags, where nothing else is named:
relaxation. Constant, x and v name nothing. A peer refuses a stranger where it names no family; mofit where it says
`unknown` or `partly` (in brackets: names no family at all). A bump stop counts as a stranger, though a non-linear
stiffness is not far from it.

Measured is the share of the squared gap that the correction removes on noise-free records that no fit saw: of the same
kind, larger, of another kind; for the measured friction damper on the measured earthquake, noise included. It is 0
where nothing is proposed: a peer without correction; `none` and `unknown` of mofit. What was told holds where at least
as much was measured, less ten points. Seconds are processor time of the process, start and imports included; to a
peer's those of the baseline are added, and to SINDy's those of the responses to single forces and parameters. Rows that
the work folder holds already are kept. A peer whose package is not installed is left out, and the page says so.
sysidentpy 0.9 declares numpy below 2.4, so that it is no extra of mofit; `pip install --no-deps sysidentpy` works
beside a newer one.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import other_rigs
from diagnosis_peers_cases import measured
from diagnosis_peers_cases.page import page
from diagnosis_peers_cases.peer import PEERS
from diagnosis_peers_cases.score import peer_row
from mofit.runtime.parallel import end_with_parent
from other_rigs_cases.campaign import make, name_of
from other_rigs_cases.cases import CASES, Cell, cells
from other_rigs_cases.score import row_of
from report_page import ROOT
from systems.running import limited

HERE = Path(__file__).parent / "diagnosis_peers_cases"
RIGS, NOISES = ("damper", "joint", "oscillator"), ("white", "AR(0.8)")


def drawn(numbers: dict[str, int], seed: int) -> list[Cell]:
    """So many campaigns of each kind at random, the cases of a kind in turn."""
    rng, found = np.random.default_rng(seed), []
    for kind, number in numbers.items():
        every = [c for c in cells(1, 1) if CASES[c.case].kind == kind and c.rig in RIGS and c.noise in NOISES]
        if kind == "none":  # several of one place differ by their repeat
            every = [c for c in cells(1, number) if CASES[c.case].kind == kind and c.rig in RIGS and c.noise in NOISES]
        mixed, seen = [every[k] for k in rng.permutation(len(every))], Counter[int]()
        turns = []
        for cell in mixed:
            turns.append(seen[cell.case])
            seen[cell.case] += 1
        found += [mixed[k] for k in np.argsort(turns, kind="stable")[:number]]
    return found


def code_digest() -> str:
    """Digest of mofit, the generator and the peers: rows of another code are not kept."""
    digest = hashlib.sha256(other_rigs.code_digest().encode())
    for file in sorted(HERE.glob("*.py")):
        if file.name not in ("page.py", "score.py", "measured.py"):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def run(cell: Cell, seed: int, work: Path, time: float, digest: str) -> dict[str, Any]:
    """Rows of one campaign: of mofit, and of every peer that is installed."""
    mofit = other_rigs.run(cell, seed, work, time, other_rigs.code_digest())
    return {"mofit": mofit, **_peers(name_of(cell, seed), make(cell, seed, work), seed, work, time, digest)}


def run_measured(data: Path, seed: int, work: Path, time: float, digest: str) -> dict[str, Any]:
    """The same rows of a measured damper."""
    measured.prepare(data, work)
    name, model = measured.NAME, measured.MODEL
    path, folder = work / "rows" / f"{name}-{digest}.json", work / "answers" / name
    if not path.exists():
        command = [str(other_rigs.CHILD), name, "--work", str(work), "--model", model, "--seed", str(seed)]
        code, cpu = _ran(command, folder, time)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(row_of(work, name, code, cpu)), encoding="utf-8")
    mofit = json.loads(path.read_text(encoding="utf-8"))
    return {"mofit": mofit, **_peers(name, model, seed, work, time, digest)}


def _peers(name: str, model: str, seed: int, work: Path, time: float, digest: str) -> dict[str, Any]:
    folder = work / "peers" / name
    baseline = folder / f"baseline-{digest}.json"
    folder.mkdir(parents=True, exist_ok=True)
    if not baseline.exists():
        command = [str(HERE / "baseline.py"), name, "--work", str(work), "--model", model, "--seed", str(seed)]
        _, cpu = _ran(command, folder, time)
        columns = json.loads((folder / "answer.json").read_text(encoding="utf-8"))["columns"]
        baseline.write_text(json.dumps({"fit": cpu - columns, "columns": columns}), encoding="utf-8")
    before = json.loads(baseline.read_text(encoding="utf-8"))
    rows = {}
    for peer, about in ((key, one) for key, one in PEERS.items() if one.installed):
        kept = folder / f"{peer}-{digest}.json"
        if not kept.exists():
            code, cpu = _ran([str(HERE / "peer.py"), peer, str(folder)], folder / peer, time)
            answer = (folder / peer / "answer.json").read_text(encoding="utf-8") if code == 0 else "null"
            cpu += before["fit"] + before["columns"] * about.columns
            said = {"answer": json.loads(answer), "code": code, "seconds": cpu}
            kept.write_text(json.dumps(said), encoding="utf-8")
        rows[peer] = peer_row(work, name, peer, json.loads(kept.read_text(encoding="utf-8")))
    return rows


def _ran(command: list[str], folder: Path, time: float) -> tuple[int | None, float]:
    """Exit code and processor time of a script of this study."""
    folder.mkdir(parents=True, exist_ok=True)
    code, _, cpu = limited([sys.executable, *command], folder, time)
    return code, cpu


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seed", type=int, default=0)
    for kind, number in (("none", 5), ("library", 8), ("own", 6), ("strangers", 5)):
        parser.add_argument(f"--{kind}", type=int, default=number, help="campaigns of that kind")
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data", help="measured data")
    parser.add_argument("--time", type=float, default=300.0, help="s of wall time per process")
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "diagnosis_peers")
    parser.add_argument("--page", type=Path, default=ROOT / "reports" / "diagnosis_peers" / "README.md")
    args = parser.parse_args()
    # the processes of the peers import what stands beside this file
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(HERE.parent), os.environ.get("PYTHONPATH"))))
    numbers = {"none": args.none, "library": args.library, "own law": args.own, "stranger": args.strangers}
    wanted = drawn(numbers, args.seed)
    sizes = f"--none {args.none} --library {args.library} --own {args.own} --strangers {args.strangers}"
    command = f"diagnosis_peers.py --seed {args.seed} {sizes} --time {args.time:g}"
    one = partial(run, seed=args.seed, work=args.work.resolve(), time=args.time, digest=code_digest())
    args.page.parent.mkdir(parents=True, exist_ok=True)
    rig = None
    if (args.data / measured.NAME).is_dir():
        rig = run_measured(args.data, args.seed, args.work.resolve(), args.time, code_digest())
    rows: dict[Cell, dict[str, Any]] = {}
    with ProcessPoolExecutor(args.parallel, get_context("spawn"), initializer=end_with_parent) as pool:
        tasks = {pool.submit(one, cell): cell for cell in wanted}
        for task in as_completed(tasks):
            found = rows[tasks[task]] = task.result()
            label = found["mofit"]
            print(label["rig"], label["excitation"], label["noise"], label["case"], label["kind"], flush=True)
            for key, row in found.items():
                print("   ", key, row["verdict"], row["families"], row["measured"], row["seconds"], flush=True)
            done = [rows[cell] for cell in wanted if cell in rows]
            args.page.write_text(page(done, rig, len(wanted), command, __doc__), encoding="utf-8")


if __name__ == "__main__":
    main()
