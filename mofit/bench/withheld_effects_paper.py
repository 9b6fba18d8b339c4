"""Withheld effects on the paper's nine sines alone: what these tell apart, and what the advised next tests add.

These tests leave many explanations alike, so that many next tests are advised: the question here is whether they
resolve. Campaigns of one effect each; otherwise the check is that of `mofit.bench.withheld_effects`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mofit.bench.withheld_effects import checked


def run(
    runs: int = 20, seed: int = 1, jobs: int = 1, folder: Path = Path("runs/bench")
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Generate, diagnose and score, as `mofit.bench.withheld_effects.run` does; ``runs`` campaigns of each effect."""
    counts = {"none": 0, "per-effect": runs, "unknown": 0, "pairs": 0, "kin": 0}
    return checked(counts, runs, seed, jobs, folder, paper=True)
