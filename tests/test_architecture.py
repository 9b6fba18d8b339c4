"""The shape of the code: layers, no circles, few and short modules, a light face, no machine named."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mofit
import mofit.data
import mofit.results
from architecture import (
    MOST_LOOSE,
    MOST_PACKAGES,
    Import,
    all_imports,
    circles,
    first_sentence,
    imports_in,
    loose_modules,
    packages,
    violations,
)

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mofit"

#: files of 300 lines or more -> why they hold one idea nevertheless
LONG_FILES: dict[str, str] = {}


def committed_files() -> list[Path]:
    try:
        listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout: which files are committed is unknown")
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


def test_imports_point_down() -> None:
    found = violations(all_imports())
    assert not found, "imports that break the layers:\n" + "\n".join(found)


def test_modules_import_each_other_in_no_circle() -> None:
    assert circles(all_imports()) == []


def test_few_modules_are_loose_and_packages_few() -> None:
    assert len(loose_modules()) <= MOST_LOOSE
    assert len(packages()) <= MOST_PACKAGES


def test_a_ninth_loose_module_is_seen(tmp_path: Path) -> None:
    for number in range(MOST_LOOSE + 1):
        (tmp_path / f"module_{number}.py").touch()
    assert len(loose_modules(tmp_path)) > MOST_LOOSE


@pytest.mark.parametrize("folder", packages(), ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_every_package_says_its_job_in_one_line(folder: Path) -> None:
    assert (folder / "__init__.py").is_file()
    line = first_sentence(folder / "__init__.py")
    assert line.endswith(".")
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))
    assert text == line


@pytest.mark.parametrize(
    ("importer", "source", "complaint"),
    [
        ("simulation.step", "from mofit.problem import Problem", "up to layer 4"),
        ("simulation.step", "def f():\n    import mofit.problem.posterior", "up to layer 4"),
        ("simulation.step", "if TYPE_CHECKING:\n    from mofit.problem import Problem", "up to layer 4"),
        ("problem", "from mofit import report", "up to layer 5"),
        ("optimize.swarm", "from mofit.sampling import chains", "must not know each other"),
        ("report.page", "from mofit.results import open_result", None),
        ("data.campaign", "from mofit import Parameter", "not from mofit itself"),
        ("data.campaign", "import mofit", "not from mofit itself"),
        ("helpers", "from mofit.errors import Issue", "no layer"),
        ("units", "from mofit.errors import Issue", None),
        ("results", "from mofit import __version__", None),
        ("models.effect", "from mofit.models.model import Symbols", None),
    ],
)
def test_the_check_sees_what_it_should(importer: str, source: str, complaint: str | None) -> None:
    found = violations(list(imports_in(source, importer, {"report", "models.model"})))
    if complaint is None:
        assert found == []
    else:
        assert len(found) == 1
        assert complaint in found[0]


def test_the_circle_check_sees_a_circle() -> None:
    there = Import("optimize.a", "optimize.b", 1)
    assert circles([there]) == []
    assert circles([there, Import("optimize.b", "optimize.a", 1)]) == [["optimize.a", "optimize.b"]]


def test_files_are_short() -> None:
    lengths = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in PACKAGE.rglob("*.py")
    }
    found = {name: length for name, length in lengths.items() if length >= 300 and name not in LONG_FILES}
    assert not found, f"files with room for two ideas (lines): {found}"
    stale = {name for name in LONG_FILES if lengths.get(name, 0) < 300}
    assert not stale, f"no longer long, take them off LONG_FILES: {stale}"


def liberties(source: str) -> list[str]:
    """What a test takes from the package that is not offered: private names, and globals that it changes."""
    tree, found = ast.parse(source), []
    ours = {"mofit"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "mofit":
            ours |= {alias.asname or alias.name for alias in node.names}
            found += [f"line {node.lineno}: imports {a.name}" for a in node.names if re.match("_[^_]", a.name)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ours:
            if re.match("_[^_]", node.attr) or isinstance(node.ctx, ast.Store):
                found.append(f"line {node.lineno}: {ast.unparse(node)}")
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("monkeypatch.setattr", "monkeypatch.setitem"):
            target = ast.unparse(node.args[0]).strip("'\"").split(".")[0]
            if target in ours:
                found.append(f"line {node.lineno}: {ast.unparse(node)}")
    return found


def test_tests_take_what_the_package_offers() -> None:
    tests = sorted((ROOT / "tests").rglob("*.py"))
    found = {path.name: liberties(path.read_text(encoding="utf-8")) for path in tests}
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    "source",
    [
        "from mofit.data.quality import _limits",
        "from mofit.data import quality\nquality._limits(1)",
        "from mofit.data import quality\nquality.LIMIT = 1",
        "from mofit.data import quality\nmonkeypatch.setattr(quality, 'LIMIT', 1)",
        "monkeypatch.setattr('mofit.data.quality.LIMIT', 1)",
    ],
)
def test_a_liberty_is_seen(source: str) -> None:
    assert len(liberties(source)) == 1


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
    from mofit.models import Model
    from mofit.parameters import Parameter

    assert mofit.Model is Model
    assert mofit.Parameter is Parameter
    assert set(mofit.__all__) == set(dir(mofit))
    for package in (mofit.data, mofit.results):
        assert all(hasattr(package, name) for name in package.__all__)
        # a module of that name, once imported, would take its place
        assert not any((Path(package.__file__).parent / f"{name}.py").exists() for name in package.__all__)
        with pytest.raises(AttributeError, match=rf"'{package.__name__}' has no attribute 'Modell'"):
            _ = package.Modell
    with pytest.raises(AttributeError, match="no attribute 'Modell'"):
        mofit.Modell  # noqa: B018 - the access is what is tested


@pytest.mark.parametrize("name", mofit.__all__)
def test_face_name_resolves(name: str) -> None:
    assert getattr(mofit, name) is not None
