"""The scorer's page and picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Words of the page for the cases of the generator.
_CASES = {
    "none": "without effect",
    "effect": "with an effect",
    "variant": "with a variant",
    "unmodelled": "with an unmodelled cause (outside the library)",
    "pair": "with two effects",
}


def page(
    found: Mapping[str, Any], down: Sequence[str], across: Sequence[str], counts: NDArray[np.int64], made_by: str = ""
) -> str:
    """All figures as Markdown, each beside what was asked for."""
    none, strong, unmodelled, pairs = found["none"], found["strong"], found["unmodelled"], found["pairs"]
    apart, later, followed = (
        found[key] for key in ("pairs_distinguishable", "pairs_with_next_test", "strong_with_next_test")
    )
    shrinkage, size, without = found["shrinkage"], found["size"], found["without_the_true_one"]
    lines = [
        "# Blind test of the diagnosis",
        "",
        *([f"Made by {made_by.rstrip('.')}.", ""] if made_by else []),
        "`scripts/withheld/generate.py` makes the campaigns; they are diagnosed with blinded labels, which",
        "`scripts/withheld/score.py` alone opens. Shares have 95 % intervals (Clopper–Pearson). T is the statistic",
        "of the true effect in the diagnosis' own score test; strength is the expectation of T, from the truth.",
        "Alone: that effect and no other is named. In the set: it is among those named, or its family is where the",
        "diagnosis says that a law explains most of the gap (partly). First: it is the most probable one.",
        "These tests can hardly",
        "distinguish some effects (delay and patch lag, force and slip offset): there a group is right, and not",
        "alone. Only effects that all others together cannot replace are removed from the candidates; the same",
        "holds for unmodelled causes. Where several candidate models are left, the proposed next test is",
        "run on the same tyre and the campaign diagnosed again, round by round; it discriminates where the truth",
        "and nothing else is named then. At best: how often the noise lets the truth fit better than its best",
        "competitor (first), or ten times better (alone), if all else were known (linear, from the truth).",
        "",
        "Campaigns: " + ", ".join(f"{count} {_CASES.get(case, case)}" for case, count in found["campaigns"].items())
        + f"; not diagnosed: {found['not_diagnosed']}.",
        "",
        "| figure | found | asked for |",
        "|---|---|---|",
        f"| no effect: false alarms | {_share(none['false_alarms'])} | ≤ 1 % |",
        f"| … upper 95 % bound | {_percent(none['upper_95'])} | ≤ 2 % |",
        *(f"| … {noise} noise | {_share(value)} | |" for noise, value in none["by_noise"].items()),
        f"| strong (T ≥ 50): named exactly, first of the set | {_share(strong['first'])} | ≥ 98 % |",
        f"| … alone in the set | {_share(strong['exact'])} | ≥ 98 %, if exactly means alone |",
        f"| … alone, and first, at best by what these tests distinguish | {_percent(found['strong_alone_at_best'])}, "
        f"{_percent(found['strong_first_at_best'])} | |",
        f"| … in the reported set | {_share(strong['in_set'])} | ≥ 99 % |",
        f"| … mean set size | {_number(strong['set_size'])} | ≤ 1.3 |",
        f"| … alone, after the proposed next tests | {_share(followed['exact'])} | |",
        f"| … … in the set | {_share(followed['in_set'])} | |",
        f"| … … campaigns with a next test, by round | {', '.join(map(str, found['next_tests_run']))} | |",
        f"| … distinguishable from all others: alone | {_share(found['strong_distinguishable']['exact'])} | |",
        f"| weaker (T from 16 to 50): in the set | {_share(found['weaker']['in_set'])} | ≥ 90 % |",
        f"| weakest (T below 16): in the set | {_share(found['weakest']['in_set'])} | |",
        f"| strength ≥ 50: named first | {_share(found['strong_in_truth']['first'])} | |",
        f"| … in the set | {_share(found['strong_in_truth']['in_set'])} | |",
        f"| strength from 16 to 50: in the set | {_share(found['weaker_in_truth']['in_set'])} | |",
        f"| variants (same cause, another law), strong: in the set | {_share(found['variants']['in_set'])} | |",
        f"| … reported partly | {_share(found['variants']['reported_partly'])} | |",
        f"| … reported unknown | {_share(found['variants']['reported_unknown'])} | |",
        f"| unmodelled causes: reported unknown | {_share(unmodelled['reported_unknown'])} | ≥ 95 % |",
        f"| … confidently wrong | {_share(unmodelled['confidently_wrong'])} | ≤ 1 % |",
        f"| … … of these partly | {_share(unmodelled['reported_partly'])} | |",
        f"| … reported none | {_share(unmodelled['reported_none'])} | |",
        f"| two at once: both named | {_share(pairs['both_named'])} | ≥ 85 % |",
        f"| … precision | {_share(pairs['precision'])} | ≥ 90 % |",
        f"| … those two in the most probable candidate model | {_share(pairs['both_first'])} | |",
        f"| … after the proposed next tests: both named | {_share(later['both_named'])} | |",
        f"| … … precision | {_share(later['precision'])} | |",
        f"| … distinguishable from all other pairs: both named | {_share(apart['both_named'])} | |",
        f"| … … precision | {_share(apart['precision'])} | |",
        f"| … … those two in the most probable candidate model | {_share(apart['both_first'])} | |",
        f"| true effect removed from the candidates: reported unknown | {_share(without['reported_unknown'])} | |",
        f"| … confidently wrong | {_share(without['confidently_wrong'])} | |",
        f"| … campaigns where it can be removed | {without['removable']} | |",
        f"| shrinkage: error of the prediction, median / 90 % | {_pair(shrinkage['predicted_off'])} | ≤ 0.02 / 0.05 |",
        f"| … error after refits, median / 90 % | {_pair(shrinkage['refitted_off'])} | |",
        f"| … 90 % intervals cover | {_share(shrinkage['covered'])} | 87 to 93 % |",
        f"| relative error of the effect size, median / 90 % | {_pair(size['error'])} | ≤ 5 % median |",
        f"| … 90 % intervals cover | {_share(size['covered'])} | |",
        f"| proposed next test discriminates | {_share(found['next_experiment']['resolved'])} | ≥ 95 % |",
        f"| … rules out all it named before but the truth | {_share(found['next_experiment']['discriminated'])} | |",
        f"| … of all that were run, also those with less power | {_share(found['next_experiment']['all'])} | |",
        f"| … … mean expected power | {_percent(found['next_experiment']['all_expected'])} | |",
        f"| seconds of processor time per diagnosis, median / 90 % | {_pair(found['seconds'])} | ≤ 30 |",
        "",
        "## By effect (strong)",
        "",
        "| effect | first | alone | in the set | reported unknown | error of the size, median |",
        "|---|---|---|---|---|---|",
        *(
            f"| {name} | {_share(value['first'])} | {_share(value['exact'])} | {_share(value['in_set'])} "
            f"| {_share(value['reported_unknown'])} "
            f"| {_number((size['by_effect'].get(name) or {}).get('median'))} |"
            for name, value in found["by_effect"].items()
        ),
        "",
        "## Unmodelled causes: reported unknown",
        "",
        "| cause | share |",
        "|---|---|",
        *(f"| {name} | {_share(value)} |" for name, value in found["by_unmodelled"].items()),
        "",
        "## Confusion",
        "",
        "![Truth by row, diagnosis by column](confusion.png)",
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
    axes.set_xlabel("diagnosis")
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
