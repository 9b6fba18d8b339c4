"""`mofit mcp` as a program meets it: tools, results, messages, and an end in order."""

import json
import os
import subprocess
import sys
from contextlib import asynccontextmanager

import numpy as np
import pytest
from damper_rig import damper_campaign
from published_schemas import violations

from mofit.cli.tools import TOOLS, command_line
from mofit.data import write_campaign

mcp = pytest.importorskip("mcp", reason="the extra mofit[mcp] is not installed")
import anyio  # noqa: E402 - comes with mcp

SPACE = """
[defaults]
sample_rate = "100 Hz"

[[tests]]
kind = "sine"
frequency = ["0.5 Hz", "2 Hz"]
amplitude = "5 mm"
duration = "15 s"
"""


@asynccontextmanager
async def server(folder):
    """A client of a server that runs in a folder."""
    program = mcp.StdioServerParameters(
        command=sys.executable, args=["-P", "-m", "mofit", "mcp"], cwd=folder, env=dict(os.environ)
    )
    async with mcp.stdio_client(program) as streams, mcp.ClientSession(*streams) as client:
        await client.initialize()
        yield client


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """One session with all calls of this module: what the server answers, by a name."""
    folder = tmp_path_factory.mktemp("mcp")
    write_campaign(damper_campaign(), folder / "damper.nc")
    (folder / "bad.nc").write_text("no netCDF")
    (folder / "numpy.py").write_text("raise SystemExit(9)")  # a file of the user shadows no module
    told = []

    async def progress(done, total, message):
        told.append((done, message))

    async def talk():
        async with server(folder) as client:
            quick = {
                "files": ["damper.nc"], "model": "kelvin_voigt_damper", "no_sample": True, "seed": 1, "out": "run",
                "test": ["0.5Hz", "1Hz"],
            }  # fmt: skip
            return {
                "tools": await client.list_tools(),
                "check": await client.call_tool("check", {"file": "damper.nc"}),
                "identify": await client.call_tool("identify", quick, progress_callback=progress),
                "bad": await client.call_tool("identify", {"files": ["bad.nc"]}),
                "argument": await client.call_tool("identify", {"file": "damper.nc", "seed": "one"}),
                "unknown": await client.call_tool("bench", {}),
            }

    return {**anyio.run(talk), "folder": folder, "told": told}


def text(answer):
    return "\n".join(block.text for block in answer.content)


def test_every_tool_names_its_arguments_with_type_and_meaning(session):
    tools = {tool.name: tool for tool in session["tools"].tools}
    assert list(tools) == ["check", "import", "identify", "diagnose", "design", "predict"]
    for name, tool in tools.items():
        assert tool.description.endswith(".")
        schema = tool.input_schema
        assert set(schema["properties"]) == set(TOOLS[name])
        assert all(one["type"] and one["description"] for one in schema["properties"].values())
    identify = tools["identify"].input_schema
    assert identify["properties"]["freq"]["items"] == {"type": "number"}
    assert identify["properties"]["seed"]["type"] == "integer"
    assert tools["predict"].input_schema["required"] == ["run", "file"]


def test_a_result_is_the_json_of_the_command(session):
    found = session["check"]
    assert not found.is_error
    assert found.structured_content["schema"] == "mofit.check/1"
    assert json.loads(found.content[0].text) == found.structured_content
    assert not violations(found.structured_content)


def test_a_model_is_identified_in_the_folder_of_the_server(session):
    found = session["identify"].structured_content
    assert found["schema"] == "mofit.identify/2"
    assert not violations(found)
    assert found["run"] == "run"
    assert found["converged"] is False  # not sampled
    assert (session["folder"] / "run" / "result.nc").is_file()
    for done, message in session["told"]:
        assert done > 0
        assert message


def test_what_cannot_be_done_is_one_message(session):
    for name, *words in (
        ("bad", "mofit: ", "bad.nc"),
        ("argument", "'file' was unexpected", "'one' is not of type 'integer'"),
        ("unknown", "bench", "check, import, identify, diagnose, design, predict"),
    ):
        assert session[name].is_error
        assert "Traceback" not in text(session[name])
        for word in words:
            assert word in text(session[name])


@pytest.mark.slow
def test_the_other_tools_work_in_the_folder_of_the_server(session):
    folder = session["folder"]
    time = np.arange(400) / 100
    stroke = 0.01 * np.sin(2 * np.pi * 0.5 * time)
    force = 2000 * stroke + 1500 * np.gradient(stroke, time) + np.random.default_rng(1).normal(0, 0.5, len(time))
    table = np.column_stack([time, 1e3 * stroke, force])
    np.savetxt(folder / "log.csv", table, "%.6g", ";", header="t [s];stroke [mm];force [N]", comments="")
    (folder / "space.toml").write_text(SPACE)
    damper = {"model": "kelvin_voigt_damper", "seed": 1}
    calls = {
        "map": ("import", {"sources": ["log.csv"], "guess": True, "out": "map.toml"}),
        "campaign": ("import", {"sources": ["log.csv"], "map": "map.toml", "out": "log.nc"}),
        "diagnosis": (
            "diagnose",
            {"files": ["damper.nc"], **damper, "effects": ["cubic_stiffness", "quadratic_damping"], "out": "gap"},
        ),
        "design": (
            "design",
            {
                "files": ["damper.nc"],
                **damper,
                "space": "space.toml",
                "parameter": ["d"],
                "budget": "20 s",
                "samples": 1,
            },
        ),
        "prediction": ("predict", {"run": "run", "file": "log.nc", "out": "predicted"}),
    }

    async def talk():
        async with server(folder) as client:
            return {name: await client.call_tool(tool, arguments) for name, (tool, arguments) in calls.items()}

    answers = anyio.run(talk)
    assert {name: text(answer) for name, answer in answers.items() if answer.is_error} == {}
    found = {name: answer.structured_content for name, answer in answers.items()}
    assert [name for name, one in found.items() if violations(one)] == []
    assert 'unit = "mm"' in found["map"]["map"]
    assert found["campaign"]["tests"][0]["samples"] == 400
    assert found["diagnosis"]["verdict"] == "none"
    assert found["design"]["parameters"]["d"]["sd"] < found["design"]["parameters"]["d"]["sd_before"]
    assert found["prediction"]["tests"][0]["nrmsd"] < 0.05
    assert (folder / "gap" / "diagnosis.html").is_file()


def test_no_value_reads_as_an_option():
    values = {"files": ["--out", "a.nc"], "model": "--seed=3", "fix": ["c=1", "d=2"], "joint": True, "resume": False}
    assert command_line("identify", values) == [
        "identify", "--json", "--model=--seed=3", "--fix=c=1", "--fix=d=2", "--joint", "--", "--out", "a.nc"
    ]  # fmt: skip


def test_without_the_extra_it_says_how_to_install_it(tmp_path):
    (tmp_path / "mcp.py").write_text("raise ModuleNotFoundError('absent', name='mcp')")
    done = subprocess.run(
        [sys.executable, "-m", "mofit", "mcp"], capture_output=True, text=True, check=False, cwd=tmp_path,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stdout == ""
    assert "pip install 'mofit[mcp]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
