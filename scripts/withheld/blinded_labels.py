"""The file of blinded labels: what each campaign hides, one packed line per campaign."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any

HEADER = "# Blinded labels: what the campaigns hide. scripts/withheld/score.py opens them last."


def add_label(path: Path, campaign: str, label: dict[str, Any]) -> None:
    """Add the label of a campaign."""
    packed = base64.b64encode(zlib.compress(json.dumps(label, sort_keys=True).encode(), 9)).decode()
    with path.open("a+b") as file:
        file.seek(0)
        before = file.read()
        # a line that an interruption cut short goes
        file.truncate(before.rfind(b"\n") + 1)
        file.write(((HEADER + "\n" if b"\n" not in before else "") + f"{campaign} {packed}\n").encode())


def read_labels(path: Path) -> dict[str, dict[str, Any]]:
    """Label by campaign."""
    return {name: json.loads(zlib.decompress(base64.b64decode(packed))) for name, packed in _lines(path).items()}


def _lines(path: Path) -> dict[str, str]:
    if not path.exists():
        return {}
    text = path.read_text(encoding="ascii")
    # a line that was cut short has no end
    whole = [line.split(" ") for line in text[: text.rfind("\n") + 1].splitlines() if not line.startswith("#")]
    return dict(parts for parts in whole if len(parts) == 2)
