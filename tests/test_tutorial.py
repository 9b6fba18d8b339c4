"""The tutorial is run as a reader would run it: every command and every line of Python, in a folder of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BLOCKS = re.findall(r"^```(sh|python)\n(.*?)^```", (ROOT / "docs" / "tutorial.md").read_text(), re.S | re.M)

#: what a notebook does with examples/notebook.py: runs every cell, and shows its last expression where it is something
NOTEBOOK = r"""
import ast, pathlib, re
names = {}
for cell in re.split(r"^# %%.*$", pathlib.Path("examples/notebook.py").read_text(), flags=re.M)[1:]:
    *lines, last = ast.parse(cell).body
    exec(compile(ast.Module(lines, []), "cell", "exec"), names)
    if not isinstance(last, ast.Expr):
        exec(compile(ast.Module([last], []), "cell", "exec"), names)
    elif (value := eval(compile(ast.Expression(last.value), "cell", "eval"), names)) is not None:
        assert "<" in value._repr_html_()
        print(type(value).__name__)
"""


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
    pages = ("first/report.html", "zener/report.html", "zener/uncertainty.html", "gap/diagnosis.html", "all/batch.html")
    for file in (*(f"runs/{page}" for page in pages), "zener.csv", "zener.c", "zener.png"):
        assert (place / file).exists(), file
    shown = subprocess.run([sys.executable, "-c", NOTEBOOK], capture_output=True, text=True, check=True, cwd=place)
    assert shown.stdout.split() == ["DataTree", "DataFrame", "Page", "Diagnosis"]
