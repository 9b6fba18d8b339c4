"""A plan as the text of a plan file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from mofit.simulate.plan import Plan


def plan_text(plan: Plan, comment: str = "") -> str:
    """The plan as TOML that `read_plan` turns into the same plan.

    Parameters
    ----------
    plan
        The plan.
    comment
        Lines for the head of the file.
    """
    entries = plan.model_dump(exclude_none=True)
    tables = {key: entries.pop(key) for key in ("attributes", "conditions", "parameters", "noise", "effects", "tests")}
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    lines += ["", *_pairs(entries)] if lines else _pairs(entries)
    for key in ("attributes", "conditions", "parameters"):
        lines += ["", f"[{key}]", *_pairs(tables[key])] if tables[key] else []
    for channel, entry in tables["noise"].items():
        lines += ["", f"[noise.{_key(channel)}]", *_pairs(entry)]
    for key in ("effects", "tests"):
        for entry in tables[key]:
            lines += ["", f"[[{key}]]", *_pairs(entry)]
    return "\n".join(lines) + "\n"


def _pairs(entries: Mapping[str, Any]) -> list[str]:
    """``key = value`` lines; empty tables are left out."""
    return [f"{_key(key)} = {_value(value)}" for key, value in entries.items() if value != {}]


def _key(key: str) -> str:
    return key if key and all(c.isascii() and (c.isalnum() or c in "-_") for c in key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    # JSON writes numbers, booleans and texts as TOML does, but for DEL
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
