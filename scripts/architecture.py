"""The shape of the code in numbers, before and after: rooms, layers, imports, circles, lengths.

``python scripts/architecture.py [--before REVISION]`` writes ``reports/architecture/README.md``, the picture
``docs/images/house.svg`` and the layer table of ``CONTRIBUTING.md``. The layers that the tests hold the code to are
here, too: `LAYERS`.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import statistics
import subprocess
import tarfile
import tempfile
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path

from route import room, routes

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mofit"

#: Layers, lowest first: an import points to a lower layer or stays inside its package.
LAYERS: tuple[tuple[str, ...], ...] = (
    ("_typing", "errors", "parameters", "quantities", "units"),
    ("runtime",),
    ("data", "models", "optimize", "sampling"),
    ("simulation",),
    ("problem", "results"),
    ("report",),
    ("prediction",),
    ("identification", "plots"),
    ("experimental_design", "diagnosis"),
    ("workflows",),
    ("cli",),
    ("__main__",),
)
LAYER = {part: number for number, parts in enumerate(LAYERS) for part in parts}
#: The foundation may import each other: units know errors.
FOUNDATION = frozenset(LAYERS[0])
#: Modules beside the packages, ``__init__`` included.
MOST_LOOSE = 8
MOST_PACKAGES = 31
#: The import that a layer test lets pass: the version is all that the face of the package gives to its parts.
VERSION = "__version__"


@dataclass(frozen=True)
class Import:
    """One import of a module of the package by another, at any depth of the file and under ``TYPE_CHECKING`` too."""

    importer: str  # dotted, without the leading "mofit."
    imported: str
    line: int

    def __str__(self) -> str:
        return f"mofit.{self.importer} line {self.line} imports mofit.{self.imported}"


def module_name(path: Path, package: Path = PACKAGE) -> str:
    """Dotted name below the package; that of a face is its folder's."""
    parts = path.relative_to(package).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


def imports_in(source: str, importer: str, modules: set[str]) -> Iterator[Import]:
    """Every import of a module of the package in ``source``."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            targets = [alias.name.split(".", 1)[1] for alias in node.names if alias.name.startswith("mofit.")]
            targets += ["__init__" for alias in node.names if alias.name == "mofit"]
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ValueError(f"mofit.{importer} line {node.lineno}: imports are absolute")
            origin = (node.module or "").split(".")
            if origin[0] != "mofit":
                continue
            base = ".".join(origin[1:])
            inner = [f"{base}.{alias.name}".lstrip(".") for alias in node.names]
            targets = [name if name in modules else base or "__init__" for name in inner if name != VERSION]
        else:
            continue
        for target in dict.fromkeys(targets):
            yield Import(importer, target, node.lineno)


def all_imports(package: Path = PACKAGE) -> list[Import]:
    """Of all modules but the package's own face, which names every layer and imports at first use."""
    files = sorted(package.rglob("*.py"))
    modules = {module_name(path, package) for path in files}
    return [
        found
        for path in files
        if path != package / "__init__.py"
        for found in imports_in(path.read_text(encoding="utf-8"), module_name(path, package), modules)
    ]


def violations(imports: list[Import]) -> list[str]:
    """What breaks the layers: imports that point up or sideways, and parts without a layer."""
    found = []
    for item in imports:
        above, below = item.importer.split(".")[0], item.imported.split(".")[0]
        if above == below or {above, below} <= FOUNDATION:
            continue
        if below == "__init__":
            found.append(f"{item}: import from the package that defines the name, not from mofit itself")
            continue
        homeless = [part for part in (above, below) if part not in LAYER]
        if homeless:
            found.append(f"{item}: '{homeless[0]}' has no layer; give it one in LAYERS")
        elif LAYER[below] > LAYER[above]:
            found.append(f"{item}: from layer {LAYER[above]} up to layer {LAYER[below]}")
        elif LAYER[below] == LAYER[above]:
            found.append(f"{item}: packages of one layer must not know each other")
    return found


def circles(imports: list[Import]) -> list[list[str]]:
    """Groups of modules that import each other in a loop, type-only imports counted (Tarjan's algorithm)."""
    graph: dict[str, set[str]] = {}
    for item in imports:
        graph.setdefault(item.importer, set()).add(item.imported)
        graph.setdefault(item.imported, set())
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
            if other in stack:
                low[node] = min(low[node], low[other])
        if low[node] == index[node]:
            group = []
            while not group or group[-1] != node:
                group.append(stack.pop())
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return sorted(found)


def loose_modules(package: Path = PACKAGE) -> list[str]:
    """Modules beside the packages."""
    return sorted(path.stem for path in package.glob("*.py"))


def packages(package: Path = PACKAGE) -> list[Path]:
    """Folders that hold modules, subfolders included."""
    return sorted({path.parent for path in package.rglob("*.py")} - {package})


def longest_function(package: Path = PACKAGE) -> tuple[int, str]:
    """Lines and name of the longest function, docstring not counted."""
    longest = (0, "")
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
                length = (node.end_lineno or 0) - first.lineno + 1
                longest = max(longest, (length, f"{module_name(path, package)}.{node.name}"))
    return longest


def storeys(imports: list[Import]) -> dict[str, int]:
    """Storey of every module: each stands above all that it imports; those of a circle stand side by side."""
    member = {name: group[0] for group in circles(imports) for name in group}
    graph: dict[str, set[str]] = {}
    for item in imports:
        above, below = (member.get(name, name) for name in (item.importer, item.imported))
        graph.setdefault(below, set())
        graph.setdefault(above, set()).update({below} - {above})
    height: dict[str, int] = {}

    def of(node: str) -> int:
        if node not in height:
            height[node] = 1 + max((of(other) for other in graph[node]), default=0)
        return height[node]

    names = {name for item in imports for name in (item.importer, item.imported)}
    return {name: of(member.get(name, name)) for name in names}


def route_figures(package: Path) -> dict[str, object]:
    """Rooms that a thing passes while a campaign is identified, and climbs on its way (see `route`)."""
    between = [
        Import(room(item.importer, package), room(item.imported, package), item.line) for item in all_imports(package)
    ]
    storey = storeys([item for item in between if item.importer != item.imported])
    figures: dict[str, object] = {}
    for thing, pairs in routes(package.parent).items():
        rooms = sorted({called for _, called in pairs}, key=lambda name: (-storey.get(name, 0), name))
        climbs = sum(storey.get(called, 0) > storey.get(caller, 0) for caller, called in pairs)
        figures[f"rooms that {thing} passes in `mofit identify`"] = len(rooms)
        figures[f"climbs of {thing} on its way"] = climbs
        figures[f"way of {thing}, top to bottom"] = ", ".join(f"`{name}`" for name in rooms)
    return figures


def measure(package: Path) -> dict[str, object]:
    """The figures of a checkout."""
    files = sorted(package.rglob("*.py"))
    lengths = [len(path.read_text(encoding="utf-8").splitlines()) for path in files]
    own = [length for path, length in zip(files, lengths, strict=True) if path.name != "__init__.py"]
    imports = all_imports(package)
    length, name = longest_function(package)
    return {
        "modules loose in `mofit/`": len(loose_modules(package)),
        "packages (folders)": len(packages(package)),
        "modules": len(files),
        "lines": sum(lengths),
        "lines per module, median (faces left out)": statistics.median(own),
        "longest module, lines": max(lengths),
        "circles of modules": len(circles(imports)),
        "storeys": max(storeys(imports).values()),
        "longest function, lines without docstring": f"{length} (`{name}`)",
        **route_figures(package),
    }


def first_sentence(path: Path) -> str:
    """Of a module's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.split("\n")[0]


def folder_list() -> list[str]:
    """A row per package: layer, name, modules, lines, job."""
    rows = []
    for folder in packages():
        name = folder.relative_to(PACKAGE).as_posix()
        files = sorted(folder.glob("*.py"))
        lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
        layer = LAYER[name.split("/")[0]]
        rows.append(
            (layer, name, f"| {layer} | `{name}` | {len(files)} | {lines} | {first_sentence(folder / '__init__.py')} |")
        )
    return [row for _, _, row in sorted(rows)]


def package_graph(imports: list[Import]) -> dict[str, set[str]]:
    """Package -> packages that it imports; those that it reaches through others anyway are left out."""
    graph: dict[str, set[str]] = {}
    for item in imports:
        above, below = item.importer.split(".")[0], item.imported.split(".")[0]
        if above != below:
            graph.setdefault(above, set()).add(below)

    def reached(name: str) -> set[str]:
        return {name}.union(*(reached(other) for other in graph.get(name, ())))

    return {
        name: {one for one in below if not any(one in reached(other) for other in below - {one})}
        for name, below in graph.items()
    }


#: Where a package stands on its layer in the picture, in box widths from the left; others follow to the right.
COLUMNS = {
    "cli": 0.75, "workflows": 1.5, "experimental_design": 0.5, "diagnosis": 1.5, "identification": 1.0,
    "prediction": 2.0, "report": 3.0, "problem": 2.0, "results": 3.0, "simulation": 2.0, "sampling": 0.0,
    "optimize": 1.0, "data": 2.0, "models": 3.0,
}  # fmt: skip
#: Sizes in the picture, in pixels: of a box, between boxes, between layers, of a line of text; characters in a line.
BOX, GAP, RISE, LINE, CHARACTERS = 196, 14, 26, 13, 30


def house(imports: list[Import]) -> str:
    """The packages on their layers with arrows to what they import, as SVG."""
    rows = [[name for name in layer if (PACKAGE / name).is_dir()] for layer in reversed(LAYERS)]
    jobs = {name: first_sentence(PACKAGE / name / "__init__.py").replace("``", "") for row in rows for name in row}
    texts = {name: [job] if name == "runtime" else textwrap.wrap(job, CHARACTERS) for name, job in jobs.items()}
    foundation = ", ".join(name for name in LAYERS[0] if not name.startswith("_"))
    right = 34 + 4 * BOX + 3 * GAP
    boxes: dict[str, tuple[float, float, float, float]] = {}
    top, parts, labels = 6.0, [], []
    for layer, row in zip(range(len(LAYERS) - 1, -1, -1), rows, strict=True):
        if not row and layer:
            continue
        height = 24.0 + LINE * max((len(texts[name]) for name in row), default=0)
        labels.append(f'<text x="14" y="{top + height / 2 + 4:.0f}" class="layer">{layer}</text>')
        for number, name in enumerate(row):
            left = 34 + COLUMNS.get(name, number) * (BOX + GAP)
            wide = (34.0, right - 34.0) if name == "runtime" else (left, float(BOX))
            boxes[name] = (wide[0], top, wide[1], height)
        if not row:
            boxes["foundation"] = (34.0, top, right - 34.0, height)
            texts["foundation"] = []
        top += height + RISE
    for name, (left, above, wide, height) in boxes.items():
        title = f"foundation: {foundation}" if name == "foundation" else name
        middle = left + wide / 2
        parts.append(f'<rect x="{left:.0f}" y="{above:.0f}" width="{wide:.0f}" height="{height:.0f}" rx="4"/>')
        parts.append(f'<text x="{middle:.0f}" y="{above + 16:.0f}" class="name">{escape(title)}</text>')
        parts += [
            f'<text x="{middle:.0f}" y="{above + 16 + LINE * (k + 1):.0f}">{escape(line)}</text>'
            for k, line in enumerate(texts[name])
        ]
    arrows = []
    for name, below in sorted(package_graph(imports).items()):
        targets = {"foundation" if LAYER.get(one) == 0 else one for one in below}
        for other in sorted(targets & set(boxes)) if name in boxes else ():
            if LAYER.get(other, 0) < 2 <= LAYER[name]:
                continue  # every package may use these two
            (left, above, wide, height), (low_left, low, low_wide, _) = boxes[name], boxes[other]
            start = min(max(low_left + low_wide / 2, left + 20), left + wide - 20)
            end = min(max(start, low_left + 20), low_left + low_wide - 20)
            down = above + height
            bend = (low - down) / 2
            arrows.append(
                f'<path d="M{start:.0f} {down:.0f} C{start:.0f} {down + bend:.0f} {end:.0f} {low - bend:.0f} '
                f'{end:.0f} {low - 5:.0f}"/>'
            )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right + 6} {top - RISE + 6:.0f}">'
        "<style>text{font:11px sans-serif;fill:#333;text-anchor:middle}.name{font:bold 13px sans-serif;fill:#111}"
        ".layer{fill:#888}rect{fill:#eef3f8;stroke:#1f5fa8}path{fill:none;stroke:#667;stroke-width:1.3;"
        'marker-end:url(#a)}</style><defs><marker id="a" viewBox="0 0 8 8" refX="4" refY="4" markerWidth="6" '
        'markerHeight="6" orient="auto"><polygon points="0,0 8,4 0,8" fill="#667"/></marker></defs>'
        '<rect width="100%" height="100%" style="fill:white;stroke:none"/>'
    )
    return "\n".join([head, *arrows, *parts, *labels, "</svg>", ""])


def layer_table() -> list[str]:
    """The packages by layer, highest first, as a table in Markdown."""
    rows = ["| layer | package | job |", "|---|---|---|"]
    for number in range(len(LAYERS) - 1, -1, -1):
        for name in LAYERS[number]:
            face = PACKAGE / name / "__init__.py"
            path = face if face.is_file() else PACKAGE / f"{name}.py"
            rows.append(f"| {number} | `{name}` | {first_sentence(path)} |")
    return rows


#: What stands around the layer table in CONTRIBUTING.md.
TABLE_MARKS = ("<!-- layers -->\n", "<!-- end of layers -->")


def with_layer_table(text: str) -> str:
    """The text of CONTRIBUTING.md with the layer table of today."""
    begin, end = TABLE_MARKS
    table = "\n".join(layer_table())
    return re.sub(f"{begin}.*?{end}", lambda _: f"{begin}{table}\n{end}", text, flags=re.DOTALL)


def checkout(revision: str, target: Path) -> Path:
    """The package as it was at a revision, unpacked."""
    archive = subprocess.run(
        ["git", "archive", revision, "mofit", "data"], cwd=ROOT, capture_output=True, check=True
    ).stdout  # fmt: skip
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        tar.extractall(target, filter="data")
    return target / "mofit"


def page(before: str) -> str:
    """The report."""
    with tempfile.TemporaryDirectory() as folder:
        earlier = measure(checkout(before, Path(folder)))
    now = measure(PACKAGE)
    return "\n".join(
        [
            "# Architecture",
            "",
            f"Written by `python scripts/architecture.py --before {before}`.",
            "",
            f"| | {before} | now |",
            "|---|---|---|",
            *(f"| {key} | {earlier[key]} | {now[key]} |" for key in now),
            "",
            "## Packages",
            "",
            "An import points to a lower layer; packages of one layer do not import each other"
            " (`tests/test_architecture.py`).",
            "",
            "| layer | package | modules | lines | job |",
            "|---|---|---|---|---|",
            *folder_list(),
            "",
        ]
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", default="1ebcfe6", help="revision to compare with")
    options = parser.parse_args()
    report = ROOT / "reports" / "architecture" / "README.md"
    report.parent.mkdir(parents=True, exist_ok=True)
    report.write_text(page(options.before), encoding="utf-8")
    picture, contributing = ROOT / "docs" / "images" / "house.svg", ROOT / "CONTRIBUTING.md"
    picture.write_text(house(all_imports()), encoding="utf-8")
    contributing.write_text(with_layer_table(contributing.read_text(encoding="utf-8")), encoding="utf-8")
    for written in (report, picture, contributing):
        print(written.relative_to(ROOT))
