"""The page of a prediction in a real browser: no errors, no requests, nothing wider than the screen."""

from pathlib import Path

import pytest
import straight_line

import mofit
from mofit.identification.settings import Settings
from mofit.prediction.page import write_prediction

CHROMIUM = next(
    (p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome") if Path(p).exists()), ""
)
ARGUMENTS = "--headless --no-sandbox --disable-gpu --disable-background-networking --no-first-run".split()

pytestmark = [pytest.mark.browser, pytest.mark.skipif(not CHROMIUM, reason="no Chromium on this machine")]


@pytest.fixture(scope="module")
def page_file(tmp_path_factory) -> Path:
    folder, model = tmp_path_factory.mktemp("prediction"), straight_line.StraightLine()
    records = straight_line.campaign(straight_line.sine_test())
    settings = Settings(jobs=1, sample=False, evaluations=200)
    _, tree = mofit.identify(records, model, settings, out=folder / "run")
    blind = straight_line.unmeasured(straight_line.sine_test("a test with a rather long name, not measured", size=2.0))
    seen = straight_line.sine_test("seen", size=2.0)
    return write_prediction(mofit.predict(tree, straight_line.campaign(seen, blind), model=model), folder)


@pytest.mark.parametrize("width", [1200, 390])
def test_the_page_opens_clean(page_file, width):
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": width, "height": 900})
        messages, requests = [], []
        page.on("console", lambda message: messages.append(message.text))
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(page_file.as_uri(), wait_until="networkidle")
        assert messages == []
        assert [url for url in requests if not url.startswith("data:")] == [page_file.as_uri()]
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.wait_for_function("[...document.images].every(image => image.complete)")
        assert page.evaluate("[...document.images].every(image => image.naturalWidth > 100)")
        browser.close()
