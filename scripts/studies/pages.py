"""How large the pages are, and how long they take to open. Writes reports/pages/README.md.

    python scripts/studies/pages.py [--work FOLDER] [--repeats 5] [--width 1200]

Each kind of page is made from the bundled (simulated) campaign with default settings, and opened in Chromium without a
network. *Loaded* is when the browser says that the page and its pictures are there, *first figure* when the first one
that is in view can be explored: the library is unpacked by then. Both count from the call, in a new tab of a browser
that runs already; given is the median of the repeats. A page that holds no figure in view has no second time.
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


def opened(browser: Any, file: Path, width: int) -> tuple[float, float]:
    """Seconds until the page is loaded, and until a figure in view can be explored."""
    page = browser.new_page(viewport={"width": width, "height": 900})
    begun = time.perf_counter()
    page.goto(file.as_uri(), wait_until="load")
    loaded = time.perf_counter() - begun
    page.wait_for_function(EXPLORED)
    explored = time.perf_counter() - begun
    page.close()
    return loaded, explored


def row(name: str, command: str, file: Path, times: Sequence[tuple[float, float]]) -> tuple[str, ...]:
    """A line of the table."""
    loaded, explored = (statistics.median(column) for column in zip(*times, strict=True))
    size = file.stat().st_size / 1e6
    kept = explored <= LIMITS[0] and size <= LIMITS[1]
    return (
        name,
        f"`mofit {command.format(work='FOLDER')}`",
        f"{size:.2f}",
        f"{loaded:.2f}",
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
    lines += table(("page", "made by", "MB", "loaded, s", "first figure, s", "1 s and 6 MB"), rows)
    write_page("pages", lines)


if __name__ == "__main__":
    main()
