"""Figures that are explored in a browser: hover, zoom, toggle, choose, brush; and the picture where scripts are off."""

from __future__ import annotations

import pytest
import result_trees
import synthetic_rigs
from browser import chromium, drawn, opened

from mofit.report import write_report

pytestmark = pytest.mark.browser

TRACES, LOOPS, DRAWS = 1, 0, 3
"""Places of the figures in the section of the signals: loops, traces, spectra, draws."""
SWARM = 1
"""Place of the swarm's figure in the section of the search."""

ZOOMED = """([plot, width]) => {
    const [low, high] = plot.layout.xaxis.range;
    return high - low < width / 2;
}"""
TITLES = """plot.explored.spec.panels.flatMap(panel => [panel.x, panel.y])
    .filter(axis => !axis.ticks || !axis.ticks.texts.some(text => /[a-z]/i.test(text)))
    .map(axis => axis.title)"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    tree = result_trees.make_result(synthetic_rigs.tyre(), steps=20)
    return write_report(tree, tmp_path_factory.mktemp("report"))


def shown(figure, what: str):
    """Of what Plotly drew: a value computed from ``plot``."""
    return figure.locator(".plot").evaluate(f"plot => {what}")


def titles(figure) -> list[str]:
    return shown(figure, "plot.layout.annotations.map(one => one.name)")


def test_a_figure_is_hovered_zoomed_and_its_traces_toggled(browser, report) -> None:
    with opened(browser, report, viewport={"width": 1200, "height": 1400}) as page:
        drawn(page, "errors")  # what is above first: it moves what is below
        drawn(page, "signals", LOOPS)
        figure = drawn(page, "signals", TRACES)
        assert not figure.locator("img").is_visible()
        panel = figure.locator(".nsewdrag").first
        panel.hover()
        area = panel.bounding_box()
        x, y = area["x"] + area["width"] / 2, area["y"] + area["height"] / 2
        page.mouse.move(x + 2, y)
        figure.locator(".hoverlayer text").first.wait_for()
        before = shown(figure, "plot.layout.xaxis.range.map(Number)")
        page.mouse.down()
        page.mouse.move(x + 30, y, steps=3)
        page.mouse.up()
        page.wait_for_function(ZOOMED, arg=[figure.locator(".plot").element_handle(), before[1] - before[0]])
        names = "plot.data.filter(trace => trace.name === 'measured').length"
        assert shown(figure, names) > 0
        figure.get_by_role("button", name="measured", exact=True).click()
        assert shown(figure, names) == 0


def test_keys_move_and_zoom_a_figure(browser, report) -> None:
    with opened(browser, report) as page:
        figure = drawn(page, "signals", TRACES)
        plot = figure.locator(".plot")
        ends = "plot.layout.xaxis.range.map(Number)"
        low, high = shown(figure, ends)
        plot.focus()
        page.keyboard.press("+")
        zoomed = shown(figure, ends)
        assert zoomed[1] - zoomed[0] == pytest.approx(0.8 * (high - low))
        page.keyboard.press("ArrowRight")
        assert shown(figure, ends)[0] > zoomed[0]
        page.keyboard.press("0")
        assert shown(figure, ends) == pytest.approx([low, high])


def test_a_test_that_is_chosen_is_shown_by_all_figures(browser, report) -> None:
    with opened(browser, report) as page:
        loops, traces, errors = drawn(page, "signals", LOOPS), drawn(page, "signals", TRACES), drawn(page, "errors")
        assert len(titles(traces)) > 1
        page.select_option("select[data-kind=test]", "sine_2Hz")
        assert titles(loops) == titles(traces) == ["sine_2Hz"]
        marked = shown(errors, "plot.data.map(trace => trace.selectedpoints).filter(Boolean).map(one => one.length)")
        assert marked
        assert set(marked) == {1}
        assert page.locator("tr.chosen").count() >= 1
        page.get_by_role("button", name="sine_1Hz", exact=True).first.click()
        assert titles(traces) == ["sine_1Hz"]
        assert page.locator("select[data-kind=test]").input_value() == "sine_1Hz"
        page.select_option("select[data-kind=test]", "")
        assert len(titles(traces)) > 1


@pytest.mark.slow
def test_a_draw_that_is_clicked_shows_its_signals(browser, report) -> None:
    with opened(browser, report) as page:
        traces, draws = drawn(page, "signals", TRACES), drawn(page, "signals", DRAWS)
        draw = "plot.data.filter(trace => trace.name.startsWith('draw ')).map(trace => trace.name)"
        assert shown(traces, draw) == []
        draws.locator(".scatterlayer .points path").first.scroll_into_view_if_needed()
        dot = draws.locator(".scatterlayer .points path").first.bounding_box()
        page.mouse.move(dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2)
        draws.locator(".hoverlayer text").first.wait_for()
        page.mouse.down()
        page.mouse.up()
        page.wait_for_function("choices.now.draw")
        assert set(shown(traces, draw)) == {f"draw {page.evaluate('choices.now.draw')}"}


@pytest.mark.slow
def test_a_firefly_that_is_clicked_shows_its_signals(browser, report) -> None:
    with opened(browser, report, viewport={"width": 1200, "height": 1400}) as page:
        traces, swarm = drawn(page, "signals", TRACES), drawn(page, "search", SWARM)
        firefly = "plot.data.filter(trace => trace.name.startsWith('firefly ')).map(trace => trace.name)"
        assert shown(traces, firefly) == []
        ring = swarm.locator(".scatterlayer").last.locator(".trace").last.locator("path.point").nth(2)
        ring.scroll_into_view_if_needed()
        place = ring.bounding_box()
        page.mouse.move(place["x"] + place["width"] / 2, place["y"] + place["height"] / 2)
        swarm.locator(".hoverlayer text").first.wait_for()
        page.mouse.down()
        page.mouse.up()
        page.wait_for_function("choices.now.firefly")
        name = page.evaluate("choices.now.firefly")
        assert set(shown(traces, firefly)) == {f"firefly {name}"}


def test_keys_move_a_box_along_the_axes_of_the_front(browser, report) -> None:
    with opened(browser, report) as page:
        front = drawn(page, "search", page.locator("#search figure").count() - 1)
        note = front.locator(".note")
        front.locator(".plot").focus()
        page.keyboard.press("ArrowRight")
        note.filter(has_text="60 of 60 points pass 1 box").wait_for()
        for _ in range(10):
            page.keyboard.press("ArrowDown")
        half = shown(front, "plot.explored.spec.panels[0].y.range[1] / 2")
        first = "part.y.filter((_, k) => part.x[k] === 0)"
        passing = shown(front, f"plot.explored.spec.panels[0].parts.filter(p => p.bundle).flatMap(part => {first})")
        expected = sum(y <= half * (1 + 1e-9) for y in passing)
        assert 0 < expected < 60
        note.filter(has_text=f"{expected} of 60 points pass 1 box").wait_for()
        page.keyboard.press("ArrowRight")
        note.filter(has_text="points pass 2 boxes").wait_for()
        page.keyboard.press("Escape")
        note.filter(has_not_text="pass").wait_for(state="attached")
        assert not shown(front, "plot.explored.brush.boxes.length")


def test_boxes_across_the_front_keep_the_lines_that_run_through_them(browser, report) -> None:
    with opened(browser, report) as page:
        count = page.locator("#search figure").count()
        front = drawn(page, "search", count - 1)
        area = front.locator(".nsewdrag").first.bounding_box()
        x, y = area["x"] + area["width"] / 2, area["y"]
        page.mouse.move(area["x"] + 2, y + 2)
        page.mouse.down()
        page.mouse.move(x, y + area["height"] / 2, steps=4)
        page.mouse.move(area["x"] + area["width"] - 2, y + area["height"] - 2, steps=4)
        page.mouse.up()
        front.locator(".note").filter(has_text="pass 1 box").wait_for()
        chosen, whole = (
            "plot.data.find(trace => trace.name === 'chosen').y",
            "plot.data.find(trace => trace.name === 'front').y",
        )
        drawn_lines = shown(front, f"[{chosen}, {whole}].map(y => y.filter(value => value !== null).length)")
        assert drawn_lines[0] == drawn_lines[1] > 0  # the box holds the whole panel
        low = shown(front, f"Math.min(...{whole}.filter(value => value !== null))")
        assert low > 0


@pytest.mark.parametrize("width", [400, 2000])
def test_narrow_or_wide_and_in_the_dark(browser, report, width) -> None:
    with opened(browser, report, viewport={"width": width, "height": 900}, color_scheme="dark") as page:
        figure = drawn(page, "signals", LOOPS)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        lefts = set(
            shown(
                figure,
                "Object.entries(plot.layout).filter(([key]) => /^xaxis/.test(key)).map(([, axis]) => axis.domain[0])",
            )
        )
        assert len(lefts) == (1 if width == 400 else 4)
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
        assert shown(figure, "plot.layout.font.color") == "rgb(230, 233, 236)"


def test_print_and_pages_without_scripts_show_the_pictures(browser, report) -> None:
    with opened(browser, report) as page:
        page.wait_for_function("[...document.images].every(image => image.complete && image.naturalWidth > 100)")
        figure = drawn(page, "errors")
        page.emulate_media(media="print")
        assert figure.locator("img").is_visible()
        assert not figure.locator(".plot").is_visible()
    with opened(browser, report, java_script_enabled=False) as page:
        assert page.locator("#errors img").is_visible()
        assert page.locator("#choices").is_hidden()
        page.wait_for_function("[...document.images].every(image => image.complete && image.naturalWidth > 100)")


@pytest.mark.slow
def test_every_figure_says_what_it_shows_and_every_axis_its_unit(browser, report) -> None:
    """Of an axis with ticks by name, or of densities, there is no unit."""
    assert report.stat().st_size < 6e6
    with opened(browser, report) as page:
        figures = page.locator("figure")
        assert figures.locator(".finding").count() == figures.count()
        for section in ("errors", "signals", "search"):
            for k in range(page.locator(f"#{section} figure").count()):
                figure = drawn(page, section, k)
                texts = shown(figure, TITLES)
                assert all(texts), (section, k)
