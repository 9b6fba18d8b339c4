"""The documentation builds without a warning and without the network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("sphinx", reason="needs the packages of the development group")
    out = tmp_path_factory.mktemp("docs")
    places = ("-d", out / "cache", ROOT / "docs", out / "html")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", *places],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return out / "html"


def test_pages_fetch_nothing(site):
    pages = list(site.glob("*.html"))
    assert len(pages) > 10
    for page in pages:
        fetched = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(?:https?:)?//[^\"]+", page.read_text())
        assert not fetched, page.name


def test_every_command_is_told(site):
    from mofit.cli import app

    text = (site / "commands.html").read_text()
    for name in app:
        if not name.startswith("-"):
            assert f"Usage: mofit {name}" in text


def test_formulas_are_drawn_by_the_browser(site):
    assert (site / "models.html").read_text().count("<math") > 10
