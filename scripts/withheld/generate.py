"""Campaigns of a tyre that hide an effect, none, or one that no library knows; what they hide goes into a sealed file.

    python scripts/withheld/generate.py --out DIR [--none 400] [--per-effect 20] [--unknown 20] [--pairs 60] [--kin 10]
                                        [--seed 1] [--list]

DIR/campaigns/<name>.nc are campaign files with opaque names; DIR/labels.sealed says what is in them, packed so that
nobody reads it by accident. Counts of effects, strangers (--unknown) and kin are per cause. What exists already is
left, so an interrupted run goes on where it stopped, and larger counts add to what is there.

Nothing here imports mofit or shares code with it: contact patch (brush.py), integrator (integrate.py), filters, noise
and file writer are its own. Shared are written equations only: the paper's model, which without hidden effect these
tyres obey, and the definition of each known effect. `--list` prints the table of causes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from campaign_writer import write_file
from causes import table
from hidden import Slot, case_of, label, setting, slots
from respond import respond
from sealed import seal, unseal
from specimen import add_noise

BATCH = 8


def main() -> None:
    """Make what is missing."""
    options = _options()
    if options.list:
        print(table())
        return
    wanted = slots(options.seed, options.none, options.per_effect, options.unknown, options.pairs, options.kin)
    folder, labels = options.out / "campaigns", options.out / "labels.sealed"
    folder.mkdir(parents=True, exist_ok=True)
    done = unseal(labels)
    missing = [s for s in wanted if s.campaign not in done or not (folder / f"{s.campaign}.nc").exists()]
    for start in range(0, len(missing), BATCH):
        make(missing[start : start + BATCH], folder, labels, done)
        print(f"{min(start + BATCH, len(missing))} of {len(missing)}", file=sys.stderr)


def make(part: list[Slot], folder: Path, labels: Path, done: Mapping[str, dict[str, Any]]) -> None:
    """Write some campaigns and seal their labels."""
    entries = [done[slot.campaign] if slot.campaign in done else label(slot) for slot in part]
    settings = [setting(slot)[1] for slot in part]
    jobs = [(case_of(entry), test) for entry, tests in zip(entries, settings, strict=True) for test in tests]
    forces = iter(respond(jobs))
    for slot, entry, tests in zip(part, entries, settings, strict=True):
        rng = slot.rng(2)
        write_file(folder / f"{slot.campaign}.nc", tests, [add_noise(next(forces), slot.noise, rng) for _ in tests])
        if slot.campaign not in done:
            seal(labels, slot.campaign, entry)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("withheld"), help="folder of the campaigns")
    for name, count in (("none", 400), ("per-effect", 20), ("unknown", 20), ("pairs", 60), ("kin", 10)):
        parser.add_argument(f"--{name}", type=int, default=count, help=f"default {count}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="print the causes and stop")
    return parser.parse_args()


if __name__ == "__main__":
    main()
