"""What an FMU declares in its modelDescription.xml; nothing of its native code is loaded."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from mofit.errors import InputError
from mofit.models.fmu.units import SiConversion, si_conversion

MODEL_EXCHANGE, CO_SIMULATION = "model exchange", "co-simulation"
#: Types of variables that channels and parameters may have.
_REAL = ("Real", "Float64")


@dataclass(frozen=True)
class Variable:
    """A real variable of an FMU; numbers are in its own unit."""

    name: str
    reference: int
    causality: str
    variability: str
    conversion: SiConversion | None
    """To SI units; None where it has no unit, or an unknown one."""
    unit: str | None
    """As the FMU spells it."""
    start: float | None
    lower: float | None
    upper: float | None
    description: str


@dataclass(frozen=True)
class FmuDescription:
    """What an FMU declares."""

    path: Path
    name: str
    version: int
    """Major version of FMI."""
    interfaces: tuple[str, ...]
    """Those that it offers: model exchange, co-simulation."""
    derives: bool
    """Whether its model exchange gives directional derivatives, and has no event indicators."""
    holds_inputs: bool
    """Whether its co-simulation holds inputs during a step, for want of ``canInterpolateInputs`` (FMI 2)."""
    fixed_step: float | None
    """Communication step of a co-simulation that takes no other one, s."""
    variables: Mapping[str, Variable]

    def those(self, *causalities: str) -> dict[str, Variable]:
        """Variables of some causalities, by name."""
        return {name: one for name, one in self.variables.items() if one.causality in causalities}


def fmpy_for(where: str) -> Any:
    """The package that reads and runs FMUs.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        import fmpy
    except ImportError:
        message = "FMUs are read and run by FMPy, which is not installed"
        raise InputError.of(where, message, "Install the extra: pip install 'mofit[fmu]'") from None
    return fmpy


def read_description(path: Path) -> FmuDescription:
    """Read the description of an FMU; no code of it runs.

    Raises
    ------
    InputError
        If FMPy is missing, the file is none or damaged, of FMI 1.0, or has neither co-simulation nor model exchange for
        this platform.
    """
    where = f"FMU '{path}'"
    if not path.is_file():
        raise InputError.of(where, "no such file", "Check the path")
    fmpy = fmpy_for(where)
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
            root = ElementTree.parse(file).getroot()
        version = str(root.get("fmiVersion"))
        usable = version.startswith(("2.", "3."))
        found = fmpy.read_model_description(str(path), validate=False) if usable else None
        platforms = fmpy.supported_platforms(str(path))
    except Exception as error:  # a damaged file raises anything, from zipfile, the XML parsers and FMPy
        reason = (str(error).splitlines() or [""])[0][:200] or type(error).__name__
        raise InputError.of(where, f"not a readable FMU ({reason})", "Export it again") from error
    if found is None:
        raise InputError.of(where, f"is of FMI {version}", "Export it as FMI 2.0 or 3.0")
    exchange, simulation = found.modelExchange, found.coSimulation
    interfaces = [name for name, one in ((MODEL_EXCHANGE, exchange), (CO_SIMULATION, simulation)) if one is not None]
    if not interfaces:
        raise InputError.of(where, "offers scheduled execution alone", "Export it for co-simulation or model exchange")
    if fmpy.platform not in platforms:
        has = f"has binaries for {', '.join(platforms) or 'no platform'}, not for {fmpy.platform}"
        raise InputError.of(where, has, "Export it for this platform, or compile its sources: fmpy compile FILE")
    return FmuDescription(
        path=path,
        name=path.stem,
        version=int(version[0]),
        interfaces=tuple(interfaces),
        derives=_derives(root) and found.numberOfEventIndicators == 0,
        holds_inputs=not (version[0] == "2" and simulation is not None and simulation.canInterpolateInputs),
        fixed_step=_fixed_step(simulation),
        variables={one.name: _variable(one, found) for one in found.modelVariables if one.type in _REAL},
    )


def _derives(root: ElementTree.Element) -> bool:
    """Whether model exchange gives directional derivatives; FMPy does not read this of FMI 3.0."""
    exchange = root.find("ModelExchange")
    names = ("providesDirectionalDerivative", "providesDirectionalDerivatives")
    return exchange is not None and any(exchange.get(name) in ("true", "1") for name in names)


def _fixed_step(simulation: Any) -> float | None:
    if simulation is None or simulation.canHandleVariableCommunicationStepSize:
        return None
    return None if simulation.fixedInternalStepSize is None else float(simulation.fixedInternalStepSize)


def _variable(one: Any, description: Any) -> Variable:
    def own(name: str) -> Any:
        """An attribute of the variable, else of its type."""
        value = getattr(one, name, None)
        return getattr(one.declaredType, name, None) if value is None and one.declaredType is not None else value

    unit = own("unit")
    base = next((known.baseUnit for known in description.unitDefinitions if known.name == unit), None)
    return Variable(
        name=one.name,
        reference=int(one.valueReference),
        causality=one.causality or "local",
        variability=one.variability or "continuous",
        conversion=si_conversion(unit, base),
        unit=unit,
        start=None if one.dimensions else _number(one.start),
        lower=_number(own("min")),
        upper=_number(own("max")),
        description=(one.description or "").strip(),
    )


def _number(text: Any) -> float | None:
    try:
        return float(text)
    except (TypeError, ValueError):
        return None
