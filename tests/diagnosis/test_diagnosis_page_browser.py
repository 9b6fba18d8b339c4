"""The page of a diagnosis in a browser: from a cell of the map to the residual of its test."""

from __future__ import annotations

from pathlib import Path

import pytest
from browser import chromium, drawn, opened
from damper_rig import damper_campaign

from mofit.cli import main
from mofit.data import write_campaign

pytestmark = pytest.mark.browser

TOP = "document.getElementById('residuals').getBoundingClientRect().top"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("diagnosed")
    write_campaign(damper_campaign((("dry_friction", (("F_d", 30.0),)),)), place / "damper.nc")
    only = ["--effects", "dry_friction", "--effects", "delay"]
    command = ["diagnose", str(place / "damper.nc"), "--model", "kelvin_voigt_damper", "--jobs", "1", *only]
    assert main([*command, "--out", str(place / "out"), "--json"]) == 0
    return place / "out"


def test_a_cell_that_is_clicked_opens_the_residual_of_its_test(folder: Path) -> None:
    with chromium() as browser, opened(browser, folder / "diagnosis.html") as page:
        figure = drawn(page, "where")
        drawn(page, "residuals")
        page.evaluate("window.scrollTo(0, 0)")
        far = page.evaluate(TOP)
        name = figure.locator(".plot").evaluate(
            """plot => {
                const { panel, row } = plot.explored.owners[0];
                const name = row.y.keys.test[0], k = row.y.ticks.values[0];
                plot.emit("plotly_click", { points: [{ curveNumber: 0, x: panel.x.ticks.values[0], y: k }] });
                return name;
            }"""
        )
        page.wait_for_function(f"Math.abs({TOP}) < 0.5 * window.innerHeight")
        assert far > page.evaluate(TOP)
        assert page.evaluate("choices.now.test") == name
