"""The scorer's page and picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def page(
    found: Mapping[str, Any], down: Sequence[str], across: Sequence[str], counts: NDArray[np.int64], made_by: str = ""
) -> str:
    """All figures as Markdown, each beside what was asked for."""
    none, strong, unknown, pairs = found["none"], found["strong"], found["unknown"], found["pairs"]
    apart, later, followed = (
        found[key] for key in ("pairs_told_apart", "pairs_with_next_test", "strong_with_next_test")
    )
    shrinkage, size, without = found["shrinkage"], found["size"], found["without_the_true_one"]
    lines = [
        "# Withheld effects",
        "",
        *([f"Made by {made_by.rstrip('.')}.", ""] if made_by else []),
        "Campaigns of `scripts/withheld/generate.py`, diagnosed without their labels; labels opened by",
        "`scripts/withheld/score.py` alone. Shares have 95 % intervals (Clopper–Pearson). T: the statistic of the true",
        "effect in the diagnosis' own score test; strength: what is expected of it, from the truth. Alone: that effect",
        "and no other is named; first: it is the most probable one. Some effects (delay and patch lag, force and slip",
        "offset) these tests can hardly tell apart: there a group is right, and not alone. Effects removed are those",
        "that all others together cannot stand in for, as the effects outside the library. Where several explanations",
        "are left, the advised next test is run on the same tyre and the campaign diagnosed again, round by round; it",
        "resolves its group where the truth and nothing else is named then. At best: how often noise lets the truth",
        "fit better than its best rival (first), or ten times better (alone), were all else known (linear, from the",
        "truth).",
        "",
        "Campaigns: " + ", ".join(f"{count} {case}" for case, count in found["campaigns"].items())
        + f"; not diagnosed: {found['not_diagnosed']}.",
        "",
        "| figure | found | asked for |",
        "|---|---|---|",
        f"| no effect: false alarms | {_share(none['false_alarms'])} | ≤ 1 % |",
        f"| … upper 95 % bound | {_percent(none['upper_95'])} | ≤ 2 % |",
        *(f"| … {noise} noise | {_share(value)} | |" for noise, value in none["by_noise"].items()),
        f"| strong (T ≥ 50): named exactly, first of the set | {_share(strong['first'])} | ≥ 98 % |",
        f"| … alone in the set | {_share(strong['exact'])} | ≥ 98 %, if exactly means alone |",
        f"| … alone, and first, at best by what these tests tell apart | {_percent(found['strong_alone_at_best'])}, "
        f"{_percent(found['strong_first_at_best'])} | |",
        f"| … in the reported set | {_share(strong['in_set'])} | ≥ 99 % |",
        f"| … mean set size | {_number(strong['set_size'])} | ≤ 1.3 |",
        f"| … alone, once the advised tests are run | {_share(followed['exact'])} | |",
        f"| … … in the set then | {_share(followed['in_set'])} | |",
        f"| … … so many were given a next test, by round | {', '.join(map(str, found['next_tests_run']))} | |",
        f"| … which these tests tell from all others: alone | {_share(found['strong_told_apart']['exact'])} | |",
        f"| weaker (T from 16 to 50): in the set | {_share(found['weaker']['in_set'])} | ≥ 90 % |",
        f"| fainter: in the set | {_share(found['fainter']['in_set'])} | |",
        f"| strength ≥ 50: named first | {_share(found['strong_in_truth']['first'])} | |",
        f"| … in the set | {_share(found['strong_in_truth']['in_set'])} | |",
        f"| strength from 16 to 50: in the set | {_share(found['weaker_in_truth']['in_set'])} | |",
        f"| kin (same cause, another law), strong: in the set | {_share(found['kin']['in_set'])} | |",
        f"| … said unknown | {_share(found['kin']['said_unknown'])} | |",
        f"| outside the library: said unknown | {_share(unknown['said_unknown'])} | ≥ 95 % |",
        f"| … confidently wrong | {_share(unknown['confidently_wrong'])} | ≤ 1 % |",
        f"| … said none | {_share(unknown['said_none'])} | |",
        f"| two at once: both named | {_share(pairs['both_named'])} | ≥ 85 % |",
        f"| … precision | {_share(pairs['precision'])} | ≥ 90 % |",
        f"| … those two by the best explanation | {_share(pairs['both_first'])} | |",
        f"| … once the advised tests are run: both named | {_share(later['both_named'])} | |",
        f"| … … precision | {_share(later['precision'])} | |",
        f"| … told from all other pairs: both named | {_share(apart['both_named'])} | |",
        f"| … … precision | {_share(apart['precision'])} | |",
        f"| … … those two by the best explanation | {_share(apart['both_first'])} | |",
        f"| true effect removed from the candidates: said unknown | {_share(without['said_unknown'])} | |",
        f"| … confidently wrong | {_share(without['confidently_wrong'])} | |",
        f"| … of so many that could be removed | {without['removable']} | |",
        f"| shrinkage: predicted off by, median / 90 % | {_pair(shrinkage['predicted_off'])} | ≤ 0.02 / 0.05 |",
        f"| … confirmed off by, median / 90 % | {_pair(shrinkage['confirmed_off'])} | |",
        f"| … 90 % intervals cover | {_share(shrinkage['covered'])} | 87 to 93 % |",
        f"| effect size off by, median / 90 % | {_pair(size['error'])} | ≤ 5 % median |",
        f"| … 90 % intervals cover | {_share(size['covered'])} | |",
        f"| advised next test resolves its group | {_share(found['next_test']['resolved'])} | ≥ 95 % |",
        f"| … parts it: others than before may be named beside the truth | {_share(found['next_test']['parted'])} | |",
        f"| … of all that were run, those without a claim too | {_share(found['next_test']['all'])} | |",
        f"| … … the mean of the chances that were said | {_percent(found['next_test']['all_foreseen'])} | |",
        f"| seconds of processor time per diagnosis, median / 90 % | {_pair(found['seconds'])} | ≤ 30 |",
        "",
        "## By effect (strong)",
        "",
        "| effect | first | alone | in the set | said unknown | size off by, median |",
        "|---|---|---|---|---|---|",
        *(
            f"| {name} | {_share(value['first'])} | {_share(value['exact'])} | {_share(value['in_set'])} "
            f"| {_share(value['said_unknown'])} "
            f"| {_number((size['by_effect'].get(name) or {}).get('median'))} |"
            for name, value in found["by_effect"].items()
        ),
        "",
        "## Outside the library: said unknown",
        "",
        "| cause | share |",
        "|---|---|",
        *(f"| {name} | {_share(value)} |" for name, value in found["by_stranger"].items()),
        "",
        "## Confusion",
        "",
        "![Truth by row, verdict by column](confusion.png)",
        "",
        "| | " + " | ".join(across) + " |",
        "|---" * (len(across) + 1) + "|",
        *(
            f"| {name} | " + " | ".join(str(c) if c else "" for c in row) + " |"
            for name, row in zip(down, counts, strict=True)
        ),
        "",
    ]  # fmt: skip
    return "\n".join(lines)


def draw(path: Path, down: Sequence[str], across: Sequence[str], counts: NDArray[np.int64]) -> None:
    """The confusion matrix, each row as shares of its campaigns."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 + 0.32 * len(across), 2.5 + 0.26 * len(down)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    image = axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(across)), across, rotation=90, fontsize=8)
    axes.set_yticks(range(len(down)), down, fontsize=8)
    for i, j in zip(*np.nonzero(counts), strict=True):
        axes.text(
            j, i, str(counts[i, j]), ha="center", va="center", fontsize=7, color="w" if shares[i, j] > 0.6 else "k"
        )
    axes.set_xlabel("verdict")
    axes.set_ylabel("what the campaign hides")
    figure.colorbar(image, label="share of the row", shrink=0.6)
    figure.savefig(path, dpi=120, metadata={"Software": None})


def _share(value: Mapping[str, Any]) -> str:
    if not value["count"]:
        return "–"
    bounds = f"{_percent(value['low'])} to {_percent(value['high'])}"
    return f"{value['hits']}/{value['count']} = {_percent(value['share'])} ({bounds})"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def _pair(value: Mapping[str, Any]) -> str:
    return f"{_number(value['median'])} / {_number(value['p90'])} (n = {value['count']})"
