"""How large the pages are, and how long they take to open. Writes reports/pages/README.md.

    python scripts/studies/pages.py [--work FOLDER] [--repeats 5] [--width 1200]

Each kind of page is made from the bundled (simulated) campaign with default settings, and opened in Chromium without a
network. *Readable* is when the browser has painted the page's content, *open* when it says that the page and the
pictures in view are there, *explored* when the first figure in view can be hovered and zoomed: until then its picture
stands in its place, while the library of figures is unpacked and started. All count from the call, in a new tab of a
browser that runs already; given are medians of the repeats. Without a figure in view there is nothing to wait for.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from report_page import ROOT, header, made_with, table, write_page

#: Asked for: s to open, and MB.
LIMITS = (1.0, 6.0)
CHROMIUM = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")
PLAN = "data/plans/paper.toml"
#: Of each page: the command that writes it, and its file; {work} is the folder.
PAGES = {
    "identify": ("identify --all-freqs --out {work}/runs/first", "runs/first/report.html"),
    "uncertainty": ("uncertainty {work}/runs/first", "runs/first/uncertainty.html"),
    "diagnose": ("diagnose --out {work}/runs/diagnosis", "runs/diagnosis/diagnosis.html"),
    "compare": (f"compare {PLAN} --out {{work}}/compare.html", "compare.html"),
    "design": (f"design {PLAN} --parameter d_M --out {{work}}/design.html", "design.html"),
    "runs": ("runs {work}/runs", "runs/runs.html"),
}
#: A figure in view can be explored.
EXPLORED = """() => {
    const seen = [...document.querySelectorAll("figure")].find(figure => figure.querySelector(".described"));
    return !seen || seen.getBoundingClientRect().top > innerHeight + 300 || seen.dataset.drawn === "yes";
}"""


def made(command: str, file: Path, work: Path) -> Path:
    """The page that a command writes; one that is there is kept."""
    if not file.exists():
        words = [word.format(work=work) for word in command.split()]
        done = subprocess.run([sys.executable, "-m", "mofit", *words], cwd=ROOT, capture_output=True, text=True)
        if not file.exists():
            sys.exit(f"mofit {' '.join(words)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return file


def opened(browser: Any, file: Path, width: int) -> tuple[float, float, float]:
    """Seconds until the page can be read, until it is open, and until a figure in view can be explored."""
    page = browser.new_page(viewport={"width": width, "height": 900})
    begun = time.perf_counter()
    page.goto(file.as_uri(), wait_until="load")
    is_open = time.perf_counter() - begun
    page.wait_for_function(EXPLORED)
    explored = time.perf_counter() - begun
    readable = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime") / 1000
    page.close()
    return readable, is_open, explored


def row(name: str, command: str, file: Path, times: Sequence[tuple[float, float, float]]) -> tuple[str, ...]:
    """A line of the table."""
    readable, is_open, explored = (statistics.median(column) for column in zip(*times, strict=True))
    size = file.stat().st_size / 1e6
    kept = is_open <= LIMITS[0] and size <= LIMITS[1]
    return (
        name,
        f"`mofit {command.format(work='FOLDER')}`",
        f"{size:.2f}",
        f"{readable:.2f}",
        f"{is_open:.2f}",
        f"{explored:.2f}",
        "kept" if kept else "exceeded",
    )


def main() -> None:
    """Make the pages, open them, write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "pages")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--width", type=int, default=1200, help="of the window, px")
    given = parser.parse_args()
    files = {name: made(command, given.work / file, given.work) for name, (command, file) in PAGES.items()}
    chromium = next((path for path in CHROMIUM if Path(path).exists()), None)
    rows = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=["--headless", "--no-sandbox", "--disable-gpu"]
        )
        version = browser.version
        for name, file in files.items():
            times = [opened(browser, file, given.width) for _ in range(given.repeats)]
            rows.append(row(name, PAGES[name][0], file, times))
        browser.close()
    command = f"pages.py --repeats {given.repeats} --width {given.width}"
    lines = header("Pages", __doc__, command, f"Chromium {version}. {made_with('plotly')}")
    lines += table(("page", "made by", "MB", "readable, s", "open, s", "explored, s", "1 s and 6 MB"), rows)
    write_page("pages", lines)


if __name__ == "__main__":
    main()
