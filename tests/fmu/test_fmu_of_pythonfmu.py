"""An FMU that another tool made: PythonFMU's, a spring and a damper."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mofit.models import find_model
from mofit.models.black_box import Record
from mofit.simulation.evaluation import IsolatedExecutor, Task

SLAVE = Path(__file__).parents[1] / "support" / "spring_damper_slave.py"
MAP = """
[inputs]
displacement = "displacement"
velocity = { variable = "velocity", unit = "m/s", derivative_of = "displacement" }
[parameters]
stiffness = { variable = "k", unit = "N/mm" }
damping = { variable = "d", unit = "N s/m" }
"""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    pytest.importorskip("fmpy", reason="needs the extra 'fmu'")
    pytest.importorskip("pythonfmu", reason="needs PythonFMU")
    folder = tmp_path_factory.mktemp("fmu")
    shutil.copy(SLAVE, folder)
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", SLAVE.name, "-d", "."]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    (folder / "map.toml").write_text(MAP)
    return folder / "SpringDamper.fmu"


def test_its_answer_is_exact(fmu):
    model = find_model(f"{fmu}:{fmu.with_name('map.toml')}")
    stiffness, damping = model.parameters
    assert (stiffness.unit, stiffness.nominal) == ("N/m", 1e6)
    assert (damping.unit, damping.nominal) == ("N s/m", 50)
    assert [one.derivative_of for one in model.inputs] == [None, "displacement"]
    assert [(one.name, one.unit) for one in model.outputs] == [("force", "N")]
    time = np.arange(101) / 100
    stroke = {"displacement": np.sin(5 * time), "velocity": 5 * np.cos(5 * time)}
    record = Record("sine", time, stroke, {})
    values = [{"stiffness": 1000.0 * k, "damping": d} for k, d in ((800.0, 30.0), (900.0, 20.0), (800.0, 30.0))]
    with IsolatedExecutor(timeout=60) as executor:
        found = executor.run([Task(model.function, record, one, ("force",)) for one in values])
    for one, own in zip(found, values, strict=True):
        assert one.failure is None
        # the code takes N/m whatever the map says: the map's N/mm make 800 of 800e3 N/m
        exact = 1e-3 * own["stiffness"] * stroke["displacement"] + own["damping"] * stroke["velocity"]
        assert one.outputs[:, 0] == pytest.approx(exact, abs=1e-9)
