"""The tutorial works as a reader would follow it, in a folder of its own."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from mofit.cli import main
from mofit.cli.app import app

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "docs" / "tutorial.md").read_text()
BLOCKS = re.findall(r"^```(sh|python)\n(.*?)^```", TEXT, re.S | re.M)
[MAP] = re.findall(r"^```toml\n(.*?)^```", TEXT, re.S | re.M)
LINES = [line for language, text in BLOCKS if language == "sh" for line in text.splitlines()]
COMMANDS = [shlex.split(line)[1:] for line in LINES if line.startswith("mofit ")]

#: What a notebook does with examples/notebook.py: it runs every cell and displays the last expression.
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


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    return tmp_path


def test_the_first_sections_make_a_campaign(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    subprocess.run([sys.executable, *shlex.split(LINES[0])[1:]], check=True)
    for command in COMMANDS[:3]:
        words = [str(name) for word in command for name in (sorted(Path().glob(word)) if "*" in word else [word])]
        assert main(words) == 0
    assert "sine_8Hz" in capsys.readouterr().out
    assert MAP in Path("my_rig/map.toml").read_text()


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(command[:1]))
def test_every_command_is_understood(command):
    app.parse_args(command, exit_on_error=False, print_error=False)


@pytest.mark.slow
def test_the_tutorial_runs_from_top_to_bottom(place):
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    outputs = []
    for language, text in BLOCKS:
        command = ["bash", "-ec", text] if language == "sh" else [sys.executable, "-c", text]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=place, env=environment)
        assert done.returncode == 0, f"{text}\n{done.stderr}"
        outputs.append(done.stdout)
    assert len(outputs) >= 8
    table = next(text for text in outputs if "tau" in text and "identified" in text)
    mean = float(re.search(r"tau\D+[\d.e+-]+\D+([\d.e+-]+)", table)[1])
    assert mean == pytest.approx(0.04, rel=0.01)  # examples/rig_csv.py
    pages = ("first/report.html", "zener/report.html", "zener/uncertainty.html", "gap/diagnosis.html", "all/batch.html")
    for file in (*(f"runs/{page}" for page in pages), "zener.csv", "zener.c", "zener.png"):
        assert (place / file).exists(), file
    shown = subprocess.run([sys.executable, "-c", NOTEBOOK], capture_output=True, text=True, check=True, cwd=place)
    assert shown.stdout.split() == ["DataTree", "DataFrame", "Page", "Diagnosis"]
