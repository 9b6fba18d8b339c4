"""The shape of the code: imports point down, the face is light, files are short, nothing names a machine."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import mofit

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mofit"

#: floor of every part (module or package directly below mofit/), lowest first
FLOORS = {
    **dict.fromkeys(("bundled", "errors", "forking", "journal", "labels", "parameters", "progress", "sobol"), 1),
    **dict.fromkeys(("netcdf", "toml_file", "units"), 1),
    **dict.fromkeys(("campaign", "campaign_file", "check", "moduli", "plots", "readers", "report", "result"), 2),
    **dict.fromkeys(("run", "signals", "validity"), 2),
    **dict.fromkeys(("kernel", "model"), 3),
    **dict.fromkeys(("drives", "few_steps", "joint", "library", "objectives", "one_period", "problem"), 4),
    **dict.fromkeys(("score", "spread"), 4),
    **dict.fromkeys(("refine", "sample", "search"), 5),
    **dict.fromkeys(("assemble", "bench", "calibration", "compared", "outcome", "posing", "refining"), 6),
    **dict.fromkeys(("report_beside", "searching", "settings", "summary", "verdict"), 6),
    **dict.fromkeys(("diagnosis", "export", "identifiability", "identify", "profiles", "simulate"), 6),
    **dict.fromkeys(("batch", "cli", "job", "options", "terminal"), 7),
    "__main__": 8,
}

#: sideways imports that are barred as well: part -> parts it must not import
BARRED = {
    "search": {"refine", "sample"},
    "refine": {"search", "sample"},
    "sample": {"search", "refine"},
    "model": {"kernel"},
}

#: the only parts of mofit that these may import
ONLY = {"report": {"errors", "forking", "labels", "result"}}

#: files of 300 lines or more -> why they hold one idea nevertheless
LONG_FILES: dict[str, str] = {}


@dataclass(frozen=True)
class Import:
    """One import of a mofit module by another."""

    importer: str  # dotted, without the leading "mofit."
    imported: str
    line: int
    typing: bool  # below `if TYPE_CHECKING`

    def __str__(self) -> str:
        return f"mofit.{self.importer} line {self.line} imports mofit.{self.imported}"


def module_name(path: Path, package: Path = PACKAGE) -> str:
    parts = path.relative_to(package).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


def imports_in(source: str, importer: str, modules: set[str]) -> Iterator[Import]:
    """Every import of a mofit module in ``source``, at any depth of it."""
    tree = ast.parse(source)
    typing_only = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.unparse(block.test)
        for statement in block.body
        for node in ast.walk(statement)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            targets = [alias.name.split(".", 1)[1] for alias in node.names if alias.name.startswith("mofit.")]
            targets += ["__init__" for alias in node.names if alias.name == "mofit"]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"mofit.{importer} line {node.lineno}: imports are absolute"
            origin = (node.module or "").split(".")
            if origin[0] != "mofit":
                continue
            base = ".".join(origin[1:])
            inner = [f"{base}.{alias.name}".lstrip(".") for alias in node.names]
            # the version is all that the package's own face may give to its parts
            targets = [name if name in modules else base or "__init__" for name in inner if name != "__version__"]
        else:
            continue
        for target in dict.fromkeys(targets):
            yield Import(importer, target, node.lineno, id(node) in typing_only)


def all_imports() -> list[Import]:
    files = sorted(path for path in PACKAGE.rglob("*.py"))
    modules = {module_name(path) for path in files}
    return [
        found
        for path in files
        if path != PACKAGE / "__init__.py"  # the face names every floor, and imports at first use
        for found in imports_in(path.read_text(encoding="utf-8"), module_name(path), modules)
    ]


def violations(imports: list[Import]) -> list[str]:
    """What breaks the floors: imports that point up, barred ones, and parts without a floor."""
    found = []
    for item in imports:
        above, below = item.importer.split(".")[0], item.imported.split(".")[0]
        if above == below:
            continue
        if below == "__init__":
            found.append(f"{item}: import from the module that defines the name, not from the face")
            continue
        homeless = [part for part in (above, below) if part not in FLOORS]
        if homeless:
            found.append(f"{item}: '{homeless[0]}' has no floor; give it one in FLOORS")
        elif FLOORS[below] > FLOORS[above]:
            found.append(f"{item}: from floor {FLOORS[above]} up to floor {FLOORS[below]}")
        elif below in BARRED.get(above, ()):
            found.append(f"{item}: {above} must not know {below}")
        elif above in ONLY and below not in ONLY[above]:
            found.append(f"{item}: {above} reads only {', '.join(sorted(ONLY[above]))}")
    return found


def circle(imports: list[Import]) -> list[str]:
    """A circle among modules at run time, as the list of its modules; empty if there is none.

    Imports for type checkers don't count: they may point sideways, also back.
    """
    graph: dict[str, set[str]] = {}
    for item in imports:
        if not item.typing:
            graph.setdefault(item.importer, set()).add(item.imported)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def committed_files() -> list[Path]:
    try:
        listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout: which files are committed is unknown")
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


def test_imports_point_down() -> None:
    found = violations(all_imports())
    assert not found, "imports that break the floors:\n" + "\n".join(found)


def test_every_part_has_a_floor() -> None:
    parts = {module_name(path).split(".")[0] for path in PACKAGE.rglob("*.py")} - {"__init__"}
    homeless = sorted(parts - set(FLOORS))
    assert not homeless, f"give these a floor in FLOORS: {homeless}"


def test_modules_import_each_other_in_no_circle() -> None:
    found = circle(all_imports())
    assert not found, "modules import each other in a circle: " + " → ".join(found)


@pytest.mark.parametrize(
    ("importer", "source", "complaint"),
    [
        ("kernel.step", "from mofit.problem import Problem", "up to floor 4"),
        ("kernel.step", "def f():\n    import mofit.library.maxwell", "up to floor 4"),
        ("kernel.step", "if TYPE_CHECKING:\n    from mofit.problem import Problem", "up to floor 4"),
        ("problem", "from mofit import search", "up to floor 5"),
        ("search.swarm", "from mofit.refine import refine", "must not know refine"),
        ("report.page", "from mofit.campaign import Campaign", "reads only errors, forking, labels, result"),
        ("campaign", "from mofit import Parameter", "not from the face"),
        ("campaign", "import mofit", "not from the face"),
        ("helpers", "from mofit.errors import Fault", "no floor"),
        ("identify", "from mofit.search import search\nfrom mofit.library import models", None),
        ("result", "from mofit import __version__", None),
        ("model.effect", "if TYPE_CHECKING:\n    from mofit.model.symbols import Symbols", None),
    ],
)
def test_the_check_sees_what_it_should(importer: str, source: str, complaint: str | None) -> None:
    found = violations(list(imports_in(source, importer, {"search", "model.symbols"})))
    if complaint is None:
        assert found == []
    else:
        assert len(found) == 1
        assert complaint in found[0]


def test_the_circle_check_sees_a_circle_and_forgives_types() -> None:
    there = Import("search.a", "search.b", 1, typing=False)
    assert circle([there]) == []
    assert circle([there, Import("search.b", "search.a", 1, typing=True)]) == []
    assert set(circle([there, Import("search.b", "search.a", 1, typing=False)])) == {"search.a", "search.b"}


def test_files_are_short() -> None:
    lengths = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in PACKAGE.rglob("*.py")
    }
    found = {name: length for name, length in lengths.items() if length >= 300 and name not in LONG_FILES}
    assert not found, f"files with room for two ideas (lines): {found}"
    stale = {name for name in LONG_FILES if lengths.get(name, 0) < 300}
    assert not stale, f"no longer long, take them off LONG_FILES: {stale}"


# built from pieces, so that this file does not find itself
MACHINE_PATH = re.compile(
    rb"(?<![\w.~+/=-])/(?:"
    + b"|".join([b"wo" + b"rk", b"ro" + b"ot", b"tm" + b"p", b"ho" + b"me", b"op" + b"t"])
    + rb")/"
)
INDEX_HOST = re.compile(
    b"|".join([rb"py" + rb"pi\.org", b"python" + b"hosted", b"index" + b"-url", b"find" + b"-links", b"file:" + b"///"])
)


@pytest.mark.parametrize(
    ("what", "pattern"), [("machine path", MACHINE_PATH), ("index host", INDEX_HOST)], ids=["path", "host"]
)
def test_no_committed_file_names_a_machine(what: str, pattern: re.Pattern[bytes]) -> None:
    found = [
        f"{path.relative_to(ROOT)}: {match.group().decode()}"
        for path in committed_files()
        for match in [pattern.search(path.read_bytes())]
        if match
    ]
    assert not found, f"{what} in committed files:\n" + "\n".join(found)


def test_the_machine_patterns_match() -> None:
    assert MACHINE_PATH.search(b'open("/ho' + b'me/me/a.nc")')
    assert not MACHINE_PATH.search(b"runs/tm" + b"p/a, https://example.org/wo" + b"rk/")
    assert INDEX_HOST.search(b"https://py" + b"pi.org/simple")


def test_import_is_light() -> None:
    heavy = ("casadi", "matplotlib", "xarray", "numpy", "scipy", "llvmlite")
    script = f"import sys, mofit; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_face_gives_what_it_names() -> None:
    from mofit.model import Model
    from mofit.parameters import Parameter

    assert mofit.Model is Model
    assert mofit.Parameter is Parameter
    assert set(mofit._HOMES) | {"__version__"} == set(mofit.__all__) == set(dir(mofit))
    with pytest.raises(AttributeError, match="no attribute 'Modell'"):
        mofit.Modell  # noqa: B018 - the access is what is tested


@pytest.mark.parametrize("name", sorted(mofit._HOMES))
def test_face_name_resolves(name: str) -> None:
    """In a process of its own, with the home imported first: a module must not hide the function of its name."""
    home, original = mofit._HOMES[name]
    if name not in ("identify", "simulate"):  # the rest has no module of its name
        assert getattr(mofit, name) is getattr(sys.modules[home], original)
        return
    script = f"import sys, mofit, {home}; assert mofit.{name} is vars(sys.modules['{home}'])['{original}']"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
