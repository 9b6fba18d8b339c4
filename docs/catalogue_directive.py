"""The directives ``models``, ``effects`` and ``kinds``: tables of what is shipped, from the code itself."""

import importlib
import inspect
import re
from collections.abc import Callable, Iterable, Iterator

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective


def models() -> list:
    """Every shipped model."""
    from mofit.models import find_model, model_names

    return [find_model(name) for name in model_names()]


def effects() -> list:
    """Every shipped effect."""
    from mofit.models import effect_names, find_effect

    return [find_effect(name) for name in effect_names()]


def model_row(model) -> list[str]:
    """Cells of a model: name, title, channels, parameters."""
    inputs = [f"{channel.name} [{channel.unit}]" for channel in model.inputs if not channel.derivative_of]
    outputs = [f"{channel.name} [{channel.unit}]" for channel in model.outputs]
    channels = f"{', '.join(inputs)} → {', '.join(outputs)}"
    return [f"`{model.name}`", model.title, channels, ", ".join(f"`{p.name}`" for p in model.parameters)]


def model_notes(model) -> list[str]:
    """What a model needs and builds on."""
    conditions = [
        f"`{c.name}` [{c.unit}]" + ("" if c.default is None else f", default {c.default:g}") for c in model.conditions
    ]
    notes = [f"Conditions: {'; '.join(conditions)}."] if conditions else []
    notes += [f"Compared with `{model.baseline}`."] if model.baseline else []
    stages = ", ".join(f"`{stage.model}`" for stage in model.stages)
    return [*notes, f"Parameters estimated beforehand: those of {stages}."] if stages else notes


def effect_row(effect) -> list[str]:
    """Cells of an effect: name, title, family, targets, typical size."""
    size = [f"`{p.name}` {p.nominal:g} {p.unit}".removesuffix(" 1") for p in effect.parameters if p.neutral is not None]
    title = effect.title if effect.candidate else f"{effect.title}; *only when named*"
    return [f"`{effect.name}`", title, effect.family, " or ".join(f"`{name}`" for name in effect.on), ", ".join(size)]


def effect_notes(effect) -> list[str]:
    """What an effect reads."""
    needs = [*effect.needs, *(c.name for c in effect.conditions if c.default is None)]
    return [f"Needs {', '.join(f'`{name}`' for name in needs)}."] if needs else []


def _text(item) -> str:
    """The docstring, which is reStructuredText, up to its first headed section."""
    text = re.split(r"\n\n\w+\n-+\n", inspect.getdoc(type(item)))[0]
    return f"````{{eval-rst}}\n{text}\n````"


def _parameters(item) -> str:
    return "\n".join(
        f"- `{p.name}` [{p.unit}]: {p.description}; typically {p.nominal:g}"
        + (f", grid {', '.join(f'{value:g}' for value in p.grid)}" if p.grid else "")
        for p in item.parameters
    )


class _Catalogue(SphinxDirective):
    """Per module a heading, a table of its classes and a description of each."""

    heads: tuple[str, ...]
    items: Callable[[], list]
    row: Callable[[object], list[str]]
    notes: Callable[[object], list[str]]

    def run(self) -> list[nodes.Node]:
        """Build tables and descriptions."""
        found: list[nodes.Node] = []
        for module, members in _by_module(self.items()):
            found.append(nodes.rubric(text=inspect.getdoc(importlib.import_module(module)).splitlines()[0].rstrip(".")))
            found.append(self._table([self.row(item) for item in members]))
            described = nodes.definition_list()
            for item in members:
                text = "\n\n".join([_text(item), *self.notes(item), _parameters(item)])
                term = nodes.term("", "", nodes.literal(text=item.name))
                described += nodes.definition_list_item("", term, self._parsed(nodes.definition(), text))
            found.append(described)
        return found

    def _table(self, rows: Iterable[list[str]]) -> nodes.table:
        group = nodes.tgroup(cols=len(self.heads))
        group += [nodes.colspec(colwidth=1) for _ in self.heads]
        head, body = nodes.thead(), nodes.tbody()
        head += self._row(self.heads)
        body += [self._row(cells) for cells in rows]
        group += [head, body]
        table = nodes.table()
        table += group
        return table

    def _row(self, cells: Iterable[str]) -> nodes.row:
        row = nodes.row()
        row += [self._parsed(nodes.entry(), cell) for cell in cells]
        return row

    def _parsed(self, node: nodes.Element, text: str) -> nodes.Element:
        self.state.nested_parse(StringList(text.splitlines(), "catalogue"), 0, node)
        return node


def _by_module(items: list) -> Iterator[tuple[str, list]]:
    modules = dict.fromkeys(type(item).__module__ for item in items)
    for module in modules:
        yield module, [item for item in items if type(item).__module__ == module]


class Models(_Catalogue):
    """The shipped models."""

    heads = ("Model", "What it is", "Input → output", "Parameters")
    items, row, notes = staticmethod(models), staticmethod(model_row), staticmethod(model_notes)


class Effects(_Catalogue):
    """The shipped effects."""

    heads = ("Effect", "What it is", "Family", "Acts on", "Typical size")
    items, row, notes = staticmethod(effects), staticmethod(effect_row), staticmethod(effect_notes)


class Kinds(_Catalogue):
    """The kinds of tests of a plan."""

    heads = ("kind", "needs", "may have")

    def run(self) -> list[nodes.Node]:
        """Build the table."""
        from mofit.simulation.virtual_rig.plan import EITHER, NEEDED, OPTIONAL

        def keys(names: Iterable[str]) -> str:
            return " ".join(f"`{name}`" for name in names)

        rows = []
        for kind, needed in NEEDED.items():
            either = " or ".join(f"`{name}`" for name in EITHER.get(kind, ()))
            rows.append([keys([kind]), keys(needed) + (f", {either}" if either else ""), keys(OPTIONAL.get(kind, ()))])
        return [self._table(rows)]


def setup(app) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("models", Models)
    app.add_directive("effects", Effects)
    app.add_directive("kinds", Kinds)
    return {"parallel_read_safe": True}
