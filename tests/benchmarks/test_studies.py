"""The studies whose pages are in reports/: each imports, and says in its docstring where its page goes."""

import importlib
import re
from pathlib import Path

import pytest

from report_page import ROOT, header, made_with, table

SCRIPTS = sorted(path for path in (ROOT / "scripts" / "studies").glob("*.py") if "def main" in path.read_text())
#: studies that share a folder of reports
PAGES = {
    "sixty_systems": "robustness/systems.md",
    "interrupted": "robustness/interrupted.md",
    "interval_coverage": "robustness/coverage.md",
    "memory": "robustness/memory.md",
    "time_temperature": "conditions/time_temperature.md",
    "damper_over_current": "conditions/damper_over_current.md",
    "tyre_curves": "tyres/curves.md",
    "specimens": "conditions/specimens.md",
    "coloured_noise": "records/coloured_noise.md",
    "many_tests": "records/many_tests.md",
}


@pytest.mark.parametrize("path", [pytest.param(path, id=path.stem) for path in SCRIPTS])
def test_a_study_imports_and_names_its_page_and_its_command(path: Path) -> None:
    if path.stem in ("batch", "specimens"):
        pytest.importorskip("distributed")
    if path.stem == "formats":
        pytest.importorskip("asammdf")
    text = importlib.import_module(path.stem).__doc__
    page = f"reports/{PAGES.get(path.stem, f'{path.stem}/README.md')}"
    assert page in text.partition("\n\n")[0]
    assert f"python scripts/studies/{path.name}" in text
    assert (ROOT / page).exists()


def test_a_page_names_its_command_and_versions() -> None:
    lines = header("Title", "First line.\n\n    usage\n\nThe method.\n", "several_modes.py --seeds 1", "A note.")
    assert lines[:3] == ["# Title", "", "The method."]
    assert lines[4] == "Written by `python scripts/studies/several_modes.py --seeds 1`. A note."
    assert table(("a", "b"), [(1, "x")]) == ["| a | b |", "|---|---|", "| 1 | x |", ""]
    assert "numpy" in made_with()


def test_the_index_of_reports_names_every_study_and_every_study_has_one_page() -> None:
    reports = ROOT / "reports"
    folders = sorted(path for path in reports.iterdir() if path.is_dir())
    index = (reports / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| \[(\w+)\]", index, re.MULTILINE)) == [folder.name for folder in folders]
    for folder in folders:
        more = {Path(page).name for page in PAGES.values() if Path(page).parent.name == folder.name}
        pages = {re.sub(r"_seed_\d+", "", page.name) for page in folder.glob("*.md")}  # one more per further seed
        assert pages == {"README.md", *more}
        assert re.search(r"(Written|Made) by ", (folder / "README.md").read_text(encoding="utf-8")), folder.name
