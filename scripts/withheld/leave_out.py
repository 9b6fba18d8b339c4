"""Which candidate to remove from each campaign to ask what a diagnosis says of an effect that it does not know.

    python scripts/withheld/leave_out.py DIR --out removed.json

Campaigns of one library effect that all others together cannot stand in for, by the sealed labels: {campaign: effect}.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from sealed import unseal
from tally import Pairing, removable


def main() -> None:
    """Write the list."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of generate.py")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    labels = unseal(options.folder / "labels.sealed")
    effects = [Pairing(name, entry, {}) for name, entry in sorted(labels.items()) if entry["case"] == "effect"]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    removed = {p.campaign: p.true[0] for p in effects if removable(p)}
    options.out.write_text(json.dumps(removed, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
