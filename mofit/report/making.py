"""How the result was made: what is needed to do it again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from markupsafe import Markup

from mofit.report.display import count, number
from mofit.report.page import Block, Details, Section, Table
from mofit.report.run import Run

_FACTS = {
    "model": "Model",
    "campaign_title": "Campaign",
    "campaign_source": "Source of the data",
    "campaign_hash": "Campaign hash",
    "configuration_hash": "Configuration hash",
    "seed": "Seed",
    "mofit_version": "mofit version",
    "created": "Created",
}


def flattened(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Nested settings as (dotted name, text) pairs."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from flattened(item, f"{path}.{name}" if path else str(name))
    elif isinstance(value, list):
        yield path, ", ".join(map(str, value)) or "–"
    else:
        yield path, "–" if value is None else str(value)


def making_section(run: Run) -> Section:
    """Facts, seconds and evaluations per stage, settings, versions."""
    attrs = run.tree.attrs
    seconds, evaluations = run.json("seconds"), run.json("evaluations")
    configuration, versions = run.json("configuration"), run.json("library_versions")
    facts = [[title, _left(str(attrs[name]))] for name, title in _FACTS.items()]
    stages = list(dict.fromkeys([*seconds, *evaluations]))
    work = [
        [
            stage,
            number(float(seconds[stage])) if stage in seconds else "–",
            count(evaluations[stage]) if stage in evaluations else "–",
        ]
        for stage in stages
    ]
    settings = [[name, _left(text)] for name, text in flattened(configuration)]
    blocks: list[Block] = [
        Table([], facts, left=[1]),
        Table(
            ["Stage", "Seconds", "Evaluations"],
            work,
            "Wall time and model evaluations (one evaluation: all tests once).",
        ),
        Details("Settings", [Table(["Setting", "Value"], settings, left=[1])]),
        Details(
            "Library versions", [Table(["Library", "Version"], [[n, str(v)] for n, v in versions.items()], left=[1])]
        ),
    ]
    data = {"facts": {name: str(attrs[name]) for name in _FACTS}, "seconds": seconds, "evaluations": evaluations}
    return Section("making", "How this was made", blocks, data | {"configuration": configuration, "versions": versions})


def _left(text: str) -> Markup:
    return Markup('<span style="white-space:normal;overflow-wrap:anywhere">{}</span>').format(text)
