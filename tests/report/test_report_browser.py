"""The page in a real browser: no errors, no requests, tabs that switch, nothing wider than the screen."""

from __future__ import annotations

from pathlib import Path

import pytest
import result_trees
import synthetic_rigs

from mofit.report import Page, write_report

CHROMIUM = next(
    (p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome") if Path(p).exists()), ""
)
ARGUMENTS = (
    "--headless --no-sandbox --disable-gpu --disable-background-networking --disable-component-update --disable-sync "
    "--no-first-run"
).split()

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium on this machine"),
]


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module", params=["tyre", "oscillator", "not converged"])
def report(request, tmp_path_factory) -> Path:
    rig = synthetic_rigs.oscillator() if request.param == "oscillator" else synthetic_rigs.tyre()
    tree = result_trees.make_result(rig, converged=request.param != "not converged", steps=20)
    return write_report(tree, tmp_path_factory.mktemp("report"))


@pytest.mark.parametrize("width", [1200, 390])
def test_the_page_opens_clean(browser, report, width) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    messages, requests = [], []
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(report.as_uri(), wait_until="networkidle")
    assert messages == []
    assert [url for url in requests if not url.startswith("data:")] == [report.as_uri()]
    assert report.stat().st_size < 10e6
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.wait_for_function("[...document.images].every(image => image.complete)")
    assert page.evaluate("[...document.images].every(image => image.naturalWidth > 100)")
    page.close()


def test_tabs_show_one_solution_at_a_time(browser, report) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    tabs, panes = page.locator("#parameters [role=tab]"), page.locator("#parameters [role=tabpanel]")
    assert tabs.count() == panes.count() == 2
    assert [panes.nth(k).is_visible() for k in range(2)] == [True, False]
    tabs.nth(1).click()
    assert [panes.nth(k).is_visible() for k in range(2)] == [False, True]
    page.keyboard.press("ArrowLeft")
    assert [panes.nth(k).is_visible() for k in range(2)] == [True, False]
    page.close()


def test_without_scripts_everything_is_shown(browser, report) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(report.as_uri())
    panes = page.locator("#parameters .pane")
    assert all(panes.nth(k).is_visible() for k in range(panes.count()))
    context.close()


def test_inside_a_notebook_the_page_keeps_its_style_and_its_links(browser, report) -> None:
    page = browser.new_page()
    messages = []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.set_content(f"<h1>notebook</h1>{Page(report.read_text(encoding='utf-8'))._repr_html_()}")
    frame = page.frame_locator("iframe")
    link = frame.locator("nav a").last
    target = link.get_attribute("href")
    link.click()
    assert frame.locator(target).is_visible()
    assert page.evaluate("getComputedStyle(document.querySelector('h1')).color") == "rgb(0, 0, 0)"
    assert messages == []
    page.close()
