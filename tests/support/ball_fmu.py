"""A bouncing ball as an FMU with events, and its exact height."""

from pathlib import Path

import numpy as np
from oscillator_fmu import pack

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="ball" guid="ball" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="ball" providesDirectionalDerivative="true"/>
  <ModelVariables>
    <ScalarVariable name="height" valueReference="0" causality="output" initial="exact">
      <Real unit="m" start="1" reinit="true"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="1" causality="local" initial="exact">
      <Real unit="m/s" start="0" reinit="true"/></ScalarVariable>
    <ScalarVariable name="rate" valueReference="2" causality="local"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="fall" valueReference="3" causality="local"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="g" valueReference="4" causality="parameter" variability="fixed">
      <Real unit="m/s2" start="9.81"/></ScalarVariable>
    <ScalarVariable name="e" valueReference="5" causality="parameter" variability="fixed">
      <Real start="0.7" min="0" max="1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/></Outputs>
    <Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>
  </ModelStructure>
</fmiModelDescription>
"""


def build_ball(folder: Path) -> Path:
    """The FMU in a folder."""
    return pack(folder, Path(__file__).with_name("ball_fmu.c"), DESCRIPTION)


def ball_height(time, g, e):
    """Parabolas between bounces; the speed after each is e times that before."""
    found, begin, speed, start = np.empty(len(time)), 0.0, 0.0, 1.0
    while begin < time[-1]:
        fall = (speed + np.sqrt(speed**2 + 2 * g * start)) / g
        own = time >= begin
        found[own] = start + speed * (time[own] - begin) - g / 2 * (time[own] - begin) ** 2
        begin, speed, start = begin + fall, e * (g * fall - speed), 0.0
    return found
