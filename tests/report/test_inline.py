"""A report inside a notebook: well-formed, self-contained, and kept apart from the notebook's own style."""

from __future__ import annotations

from html import unescape
from html.parser import HTMLParser

import pytest
import result_trees
import synthetic_rigs

from mofit.errors import InputError
from mofit.report import Page, report_page, write_report
from mofit.results import write_result

VOID = {"base", "br", "hr", "img", "input", "link", "meta"}


class Tags(HTMLParser):
    """Tags that are open, and the attributes of all that were seen."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def tree():
    return result_trees.make_result(synthetic_rigs.damper(), steps=20)


def read(html: str) -> Tags:
    tags = Tags()
    tags.feed(html)
    tags.close()
    assert tags.open == []
    return tags


@pytest.mark.parametrize("kind", ["report", "uncertainty"])
def test_the_frame_holds_the_whole_page_and_fetches_nothing(tree, kind):
    shown = report_page(tree, kind)
    (frame,) = read(shown._repr_html_()).seen
    assert frame[0] == "iframe"
    inside = frame[1]["srcdoc"]
    assert inside.replace('<base href="about:srcdoc">', "") == shown.html
    page = read(inside)
    addresses = [attrs[key] for _, attrs in page.seen for key in ("src", "href") if key in attrs]
    assert all(address.startswith(("data:", "#", "about:srcdoc")) for address in addresses)
    assert {"style", "main"} & {tag for tag, _ in page.seen}


@pytest.mark.slow
def test_a_folder_gives_the_page_that_the_report_would_be_and_nothing_is_written(tree, tmp_path):
    write_result(tree, tmp_path / "run")
    shown = report_page(tmp_path / "run")
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["result.nc"]
    assert shown.html == write_report(tree, tmp_path / "run").read_text(encoding="utf-8")


def test_quotes_and_ampersands_survive():
    text = """<!doctype html><html><head></head><body title="a'b">&lt;i&gt; &amp; "c"</body></html>"""
    frame = read(Page(text)._repr_html_()).seen[0]
    assert frame[1]["srcdoc"].replace('<base href="about:srcdoc">', "") == text
    assert unescape(text) != text


def test_a_missing_run_or_an_unknown_page_is_one_clear_error(tree, tmp_path):
    with pytest.raises(InputError, match="there is no file"):
        report_page(tmp_path)
    with pytest.raises(InputError, match="Use one of report, uncertainty"):
        report_page(tree, "diagnosis")
