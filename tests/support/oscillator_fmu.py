"""An oscillator as an FMU, compiled by the test from C, and its exact solution."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

SOURCE = Path(__file__).with_name("oscillator_fmu.c")

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="oscillator" guid="oscillator" numberOfEventIndicators="0">
  {exchange}
  <CoSimulation modelIdentifier="oscillator" canHandleVariableCommunicationStepSize="true" {interpolates}/>
  <UnitDefinitions>
    <Unit name="N/mm"><BaseUnit kg="1" s="-2" factor="1000"/></Unit>
    <Unit name="lump"><BaseUnit kg="1" factor="0.5"/></Unit>
  </UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="position" valueReference="0" causality="output" initial="exact">
      <Real unit="m" start="0"/></ScalarVariable>
    <ScalarVariable name="velocity" valueReference="1" causality="local" initial="exact">
      <Real unit="m/s" start="0"/></ScalarVariable>
    <ScalarVariable name="der(position)" valueReference="2" causality="local"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="acceleration" valueReference="3" causality="output">
      <Real unit="m/s2" derivative="2"/></ScalarVariable>
    <ScalarVariable name="F" valueReference="4" causality="input" description="force"><Real unit="N" start="0"/>
      </ScalarVariable>
    <ScalarVariable name="k" valueReference="5" causality="parameter" variability="tunable" description="stiffness">
      <Real unit="N/m" start="400" min="0"/></ScalarVariable>
    <ScalarVariable name="d" valueReference="6" causality="parameter" variability="fixed">
      <Real unit="N.s/m" start="4"/></ScalarVariable>
    <ScalarVariable name="m" valueReference="7" causality="parameter" variability="fixed">
      <Real unit="kg" start="1" min="0.5" max="2"/></ScalarVariable>
    <ScalarVariable name="x_0" valueReference="8" causality="parameter" variability="fixed">
      <Real unit="m" start="0" min="-0.5" max="0.5"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/><Unknown index="4"/></Outputs>
    <Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>
  </ModelStructure>
</fmiModelDescription>
"""
EXCHANGE = '<ModelExchange modelIdentifier="oscillator" providesDirectionalDerivative="true"/>'


def build(folder: Path, *defines: str, exchange: bool = True, interpolates: bool = False, change=str) -> Path:
    """The FMU in a folder; ``change`` alters its description."""
    fmpy = pytest.importorskip("fmpy", reason="needs the extra 'fmu'")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or fmpy.platform != "linux64":
        pytest.skip("needs a C compiler on 64-bit Linux")
    library = folder / "oscillator.so"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = [f"-D{name}" for name in defines]
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-O1", *flags, f"-I{headers}", SOURCE, "-o", library, "-lm"], check=True
    )
    told = 'canInterpolateInputs="true"' if interpolates else ""
    path = folder / "oscillator.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        description = DESCRIPTION.format(exchange=EXCHANGE if exchange else "", interpolates=told)
        archive.writestr("modelDescription.xml", change(description))
        archive.write(library, "binaries/linux64/oscillator.so")
    return path


def position(time, k, d, m, x_0=0.0, force=0.0, slope=0.0):
    """Exact position under a force that begins at ``force`` and grows by ``slope`` per second."""
    decay, rest = d / (2 * m), force / k - d * slope / k**2
    omega = np.sqrt(k / m - decay**2)
    a, b = x_0 - rest, (decay * (x_0 - rest) - slope / k) / omega
    ringing = np.exp(-decay * time) * (a * np.cos(omega * time) + b * np.sin(omega * time))
    return rest + slope / k * time + ringing
