"""A headless Chromium for tests of pages, and what a page says and fetches in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next(
    (p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome") if Path(p).exists()), ""
)
ARGUMENTS = (
    "--headless --no-sandbox --disable-gpu --disable-background-networking --disable-component-update --disable-sync "
    "--no-first-run"
).split()


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser; the test is skipped where there is none."""
    if not CHROMIUM:
        pytest.skip("no Chromium on this machine")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@contextmanager
def opened(browser: Any, file: Path, **settings: Any) -> Iterator[Any]:
    """A page that says nothing on the console and fetches nothing, until it is closed."""
    context = browser.new_context(**settings)
    page = context.new_page()
    said, fetched = [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: fetched.append(request.url))
    page.goto(file.as_uri())
    yield page
    assert said == []
    assert [url for url in fetched if not url.startswith(("data:", "blob:"))] == [file.as_uri()]
    context.close()


def drawn(page: Any, section: str, number: int = 0) -> Any:
    """A figure of a section, once it is drawn to be explored."""
    figure = page.locator(f"#{section} figure").nth(number)
    figure.scroll_into_view_if_needed()
    page.wait_for_function(
        "([section, number]) => document.querySelectorAll(`#${section} figure`)[number].dataset.drawn",
        arg=[section, number],
    )
    return figure
