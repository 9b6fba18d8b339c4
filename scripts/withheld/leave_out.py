"""Which candidate to remove from each campaign, to ask what a diagnosis reports of an effect outside its library.

    python scripts/withheld/leave_out.py DIR --out removed.json

The campaigns of one library effect that all others together cannot replace, from the labels: {campaign: effect}.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from blinded_labels import read_labels
from tally import Pairing, removable


def main() -> None:
    """Write the list."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of generate.py")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    labels = read_labels(options.folder / "labels.blinded")
    effects = [Pairing(name, entry, {}) for name, entry in sorted(labels.items()) if entry["case"] == "effect"]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    removed = {p.campaign: p.true[0] for p in effects if removable(p)}
    options.out.write_text(json.dumps(removed, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
