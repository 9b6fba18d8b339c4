"""CONTRIBUTING.md: its layer table, the way of a campaign, and the additions that it shows."""

import re
import shutil
import subprocess
import sys
import textwrap
from importlib import import_module
from pathlib import Path

import pytest

from architecture import all_imports, circles, violations, with_layer_table

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ADDITIONS = dict(re.findall(r"^### Add (?:a|an) (.+)\n(?:(?!###)[\s\S])*?^```diff\n([\s\S]*?)^```$", TEXT, re.M))


def changed_files(diff: str) -> list[str]:
    return re.findall(r"^\+\+\+ b/(.+)$", diff, re.M)


@pytest.fixture(scope="module")
def extended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what the additions need, with all of them applied."""
    copy = tmp_path_factory.mktemp("repository")
    for name in ("mofit", "tests/support"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "tests/conftest.py"):
        shutil.copy(ROOT / name, copy / name)
    for name in {file for diff in ADDITIONS.values() for file in changed_files(diff)}:
        if (ROOT / name).is_file():
            shutil.copy(ROOT / name, copy / name)
    (copy / "data").symlink_to(ROOT / "data")
    for diff in ADDITIONS.values():
        applied = subprocess.run(["git", "apply"], cwd=copy, input=diff, capture_output=True, text=True)
        assert applied.returncode == 0, applied.stderr
    return copy


def run(copy: Path, *command: str) -> str:
    """Run Python in the copy, which comes first on its path."""
    done = subprocess.run([sys.executable, *command], cwd=copy, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_layer_table_is_that_of_the_code() -> None:
    written, found = (re.findall(r"^\| (\d+) \| `(\w+)` \|", text, re.M) for text in (TEXT, with_layer_table(TEXT)))
    assert written == found, "run python scripts/architecture.py"


def test_the_way_of_a_campaign_names_functions_where_they_are_defined() -> None:
    steps = re.findall(r"^\| \d+ \| `(mofit\..+?)` \|", TEXT, re.M)
    assert len(steps) >= 10
    for step in steps:
        module, _, name = step.rpartition(".")
        assert getattr(import_module(module), name).__module__ == module, step


def test_additions_of_at_most_two_files_are_shown() -> None:
    assert list(ADDITIONS) == ["model", "effect", "import format", "report figure", "search"]
    assert all(len(changed_files(diff)) == 2 for diff in ADDITIONS.values())


@pytest.mark.slow
def test_their_tests_pass(extended: Path) -> None:
    tests = [name for diff in ADDITIONS.values() for name in changed_files(diff) if name.startswith("tests/")]
    run(extended, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests)


def test_they_keep_to_style_and_layers(extended: Path) -> None:
    files = [name for diff in ADDITIONS.values() for name in changed_files(diff)]
    run(extended, "-m", "ruff", "check", "--no-cache", *files)
    run(extended, "-m", "ruff", "format", "--no-cache", "--check", *files)
    imports = all_imports(extended / "mofit")
    assert violations(imports) == []
    assert circles(imports) == circles(all_imports())


@pytest.mark.slow
def test_the_figure_is_on_the_report(extended: Path) -> None:
    script = """
        import sys
        sys.path.append("tests/support")
        from pathlib import Path
        import result_trees, synthetic_rigs
        from mofit.report import write_report
        print(write_report(result_trees.make_result(synthetic_rigs.tyre(), steps=40), Path()).read_text())
    """
    assert '<section id="effective_draws"' in run(extended, "-c", textwrap.dedent(script))


def test_the_commands_know_them(extended: Path) -> None:
    script = """
        from mofit.data.importers.registry import known_endings
        from mofit.models import effect_names, model_names
        print(*model_names(), *effect_names(), *known_endings())
    """
    known = run(extended, "-c", textwrap.dedent(script)).split()
    assert {"power_law_damper", "load_cell_curvature", ".npz"} <= {*known}
