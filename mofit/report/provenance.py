"""How the result was made: what is needed to reproduce it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from markupsafe import Markup

from mofit.report.run import Run
from mofit.report.toolkit.blocks import Block, Column, Details, Section, Table, words
from mofit.report.toolkit.formatting import count, number

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


def provenance_section(run: Run) -> Section:
    """Facts, seconds and evaluations per stage, settings, versions."""
    facts = {name: str(run.tree.attrs[name]) for name in _FACTS}
    seconds, evaluations = run.json("seconds"), run.json("evaluations")
    configuration, versions = run.json("configuration"), run.json("library_versions")
    stages = list(dict.fromkeys([*seconds, *evaluations]))
    work = Table(
        [
            Column("Stage", stages),
            Column("Seconds", [number(float(seconds[stage])) if stage in seconds else "–" for stage in stages]),
            Column("Evaluations", [count(evaluations[s]) if s in evaluations else "–" for s in stages]),
        ],
        "Wall time and model evaluations (one evaluation: all tests once).",
    )
    blocks: list[Block] = [
        _pairs("", "", zip(_FACTS.values(), facts.values(), strict=True)),
        work,
        Details("Settings", [_pairs("Setting", "Value", flattened(configuration))]),
        Details("Library versions", [_pairs("Library", "Version", flattened(versions))]),
    ]
    data = {"facts": facts, "seconds": seconds, "evaluations": evaluations, "configuration": configuration}
    return Section("provenance", "Provenance", blocks, data | {"versions": versions})


def _pairs(name: str, value: str, rows: Iterator[tuple[str, str]]) -> Table:
    """A table of two columns, of which the second may break into lines anywhere."""
    cell = Markup('<span style="white-space:normal;overflow-wrap:anywhere">{}</span>')
    found = list(rows)
    return Table([Column(name, [key for key, _ in found]), words(value, [cell.format(text) for _, text in found])])
