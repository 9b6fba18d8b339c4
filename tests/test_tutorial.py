"""The tutorial is run as a reader would run it: every command and every line of Python, in a folder of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BLOCKS = re.findall(r"^```(sh|python)\n(.*?)^```", (ROOT / "docs" / "tutorial.md").read_text(), re.S | re.M)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tutorial")
    (folder / "examples").symlink_to(ROOT / "examples")
    return folder


@pytest.mark.slow
def test_the_tutorial_runs_from_top_to_bottom(place):
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    told = []
    for language, text in BLOCKS:
        command = ["bash", "-ec", text] if language == "sh" else [sys.executable, "-c", text]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=place, env=environment)
        assert done.returncode == 0, f"{text}\n{done.stderr}"
        told.append(done.stdout)
    assert len(told) >= 8
    table = next(text for text in told if "tau" in text and "identified" in text)
    mean = float(re.search(r"tau\D+[\d.e+-]+\D+([\d.e+-]+)", table)[1])
    assert mean == pytest.approx(0.04, rel=0.01)  # examples/rig_csv.py
    for page in ("first/report.html", "zener/report.html", "zener/uncertainty.html", "gap/diagnosis.html"):
        assert (place / "runs" / page).exists()
