"""Campaigns of a tyre that hide an effect of the library, one outside it, or none; with blinded labels.

    python scripts/withheld/generate.py --out DIR [--none 400] [--per-effect 20] [--unmodelled 20] [--pairs 60]
                                        [--variants 10] [--paper] [--seed 1] [--jobs 1] [--list]

DIR/campaigns/<name>.nc are campaign files with opaque names. DIR/labels.blinded says what they hide, packed so that
nobody reads it by accident. The counts of effects, unmodelled causes and variants are per cause. What exists stays, so
an interrupted run resumes, and larger counts add to what is there.

Nothing here imports mofit or shares code with it: contact patch (brush.py), integrator (integrate.py), filters, noise
and file writer are its own. Shared are written equations only: the paper's model, which these tyres obey without a
hidden effect, and the definition of each effect of the library. `--list` prints the table of causes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from blinded_labels import add_label, read_labels
from campaign_writer import write_file
from causes import table
from hidden import Slot, case_of, labels_of, setting, slots
from respond import respond
from specimen import add_noise

BATCH = 8


def main() -> None:
    """Make what is missing."""
    options = _options()
    if options.list:
        print(table())
        return
    wanted = slots(
        options.seed,
        options.none,
        options.per_effect,
        options.unmodelled,
        options.pairs,
        options.variants,
        options.paper,
    )
    folder, labels = options.out / "campaigns", options.out / "labels.blinded"
    folder.mkdir(parents=True, exist_ok=True)
    done = read_labels(labels)
    missing = [s for s in wanted if s.campaign not in done or not (folder / f"{s.campaign}.nc").exists()]
    parts = [missing[start : start + BATCH] for start in range(0, len(missing), BATCH)]
    labelled = [{slot.campaign: done[slot.campaign] for slot in part if slot.campaign in done} for part in parts]
    count = 0
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        for entries in pool.map(partial(make, folder=folder), parts, labelled):
            for name, entry in entries.items():
                add_label(labels, name, entry)
            count += len(entries)
            print(f"{count} labels, of {len(missing)} campaigns", file=sys.stderr)


def make(part: list[Slot], labelled: Mapping[str, dict[str, Any]], folder: Path) -> dict[str, dict[str, Any]]:
    """Write some campaigns, and return the labels of those that have none yet."""
    fresh = labels_of([slot for slot in part if slot.campaign not in labelled])
    entries = {**labelled, **fresh}
    settings = [setting(slot)[1] for slot in part]
    jobs = [
        (case_of(entries[slot.campaign]), test) for slot, tests in zip(part, settings, strict=True) for test in tests
    ]
    forces = iter(respond(jobs))
    for slot, tests in zip(part, settings, strict=True):
        rng = slot.rng(2)
        write_file(folder / f"{slot.campaign}.nc", tests, [add_noise(next(forces), slot.noise, rng) for _ in tests])
    return fresh


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("withheld"), help="folder of the campaigns")
    for name, count in (("none", 400), ("per-effect", 20), ("unmodelled", 20), ("pairs", 60), ("variants", 10)):
        parser.add_argument(f"--{name}", type=int, default=count, help=f"default {count}")
    parser.add_argument("--paper", action="store_true", help="of all sines the paper's nine alone")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes; campaigns do not depend on it")
    parser.add_argument("--list", action="store_true", help="print the causes and stop")
    return parser.parse_args()


if __name__ == "__main__":
    main()
