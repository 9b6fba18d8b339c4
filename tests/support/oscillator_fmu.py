"""An oscillator as an FMU, compiled by the test from C, and its exact solution."""

import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

SOURCES = {2: Path(__file__).with_name("oscillator_fmu.c"), 3: Path(__file__).with_name("oscillator_fmu3.c")}

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
DESCRIPTION_3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="oscillator" instantiationToken="oscillator">
  {exchange}
  <CoSimulation modelIdentifier="oscillator" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <Float64 name="position" valueReference="0" causality="output" initial="exact" unit="m" start="0"/>
    <Float64 name="velocity" valueReference="1" causality="local" initial="exact" unit="m/s" start="0"/>
    <Float64 name="der(position)" valueReference="2" causality="local" derivative="0"/>
    <Float64 name="acceleration" valueReference="3" causality="output" derivative="1"/>
    <Float64 name="F" valueReference="4" causality="input" unit="N" start="0"/>
    <Float64 name="k" valueReference="5" causality="parameter" variability="tunable" unit="N/m" start="400" min="0"/>
    <Float64 name="d" valueReference="6" causality="parameter" variability="fixed" unit="N.s/m" start="4"/>
    <Float64 name="m" valueReference="7" causality="parameter" variability="fixed"
     unit="kg" min="0.5" max="2" start="1"/>
    <Float64 name="x_0" valueReference="8" causality="parameter" variability="fixed" start="0" min="-0.5" max="0.5"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="0"/><Output valueReference="3"/>
    <ContinuousStateDerivative valueReference="2"/><ContinuousStateDerivative valueReference="3"/>
  </ModelStructure>
</fmiModelDescription>
"""
EXCHANGE = '<ModelExchange modelIdentifier="oscillator" providesDirectionalDerivative="true"/>'
FOLDERS = {2: "linux64", 3: "x86_64-linux"}
EXCHANGE_3 = EXCHANGE.replace("Derivative=", "Derivatives=")


def build(
    folder: Path, *defines: str, version=2, exchange: bool = True, interpolates: bool = False, change=str, extra=""
) -> Path:
    """The FMU in a folder; ``change`` alters its description, ``extra`` is C code beside its own."""
    told = 'canInterpolateInputs="true"' if interpolates else ""
    text, part = {2: (DESCRIPTION, EXCHANGE), 3: (DESCRIPTION_3, EXCHANGE_3)}[version]
    description = change(text.format(exchange=part if exchange else "", interpolates=told))
    return pack(folder, SOURCES[version], description, version, [f"-D{name}" for name in defines], extra)


def pack(folder: Path, source: Path, description: str, version=2, flags=(), extra="") -> Path:
    """Compile a source and pack it with its description; the FMU is named after the source."""
    fmpy = pytest.importorskip("fmpy", reason="needs the extra 'fmu'")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or fmpy.platform != "linux64":
        pytest.skip("needs a C compiler on 64-bit Linux")
    headers = Path(fmpy.__file__).parent / "c-code"
    # FMPy asks for every function of the standard: those that the source lacks answer with an error
    names = re.findall(r"Export +fmi\w+TYPE +(\w+);", (headers / f"fmi{version}Functions.h").read_text())
    name, rest = source.stem.partition("_")[0], folder / "rest.c"
    rest.write_text(extra + "".join(f"__attribute__((weak)) int {one}(void) {{ return 3; }}\n" for one in names))
    library = folder / f"{name}.so"
    command = [compiler, "-shared", "-fPIC", "-O1", *flags, f"-I{headers}", source, rest, "-o", library, "-lm"]
    subprocess.run(command, check=True)
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{FOLDERS[version]}/{name}.so")
    return path


def position(time, k, d, m, x_0=0.0, force=0.0, slope=0.0):
    """Exact position under a force that begins at ``force`` and grows by ``slope`` per second."""
    decay, rest = d / (2 * m), force / k - d * slope / k**2
    omega = np.sqrt(k / m - decay**2)
    a, b = x_0 - rest, (decay * (x_0 - rest) - slope / k) / omega
    ringing = np.exp(-decay * time) * (a * np.cos(omega * time) + b * np.sin(omega * time))
    return rest + slope / k * time + ringing
