"""``modelDescription.xml`` of FMI 3.0 and 2.0, and ``buildDescription.xml``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

from mofit import __version__
from mofit.results.fmu.equations import TOLERANCE
from mofit.results.fmu.variables import Contents, FmuVariable, writable
from mofit.units import UnitError, base_units

#: what a variable of each causality is besides
_VARIABILITY = {
    "independent": "continuous", "input": "continuous", "parameter": "tunable",
    "output": "continuous", "local": "continuous",
}  # fmt: skip
_INITIAL = {"parameter": "exact", "output": "calculated", "local": "calculated"}
_ABLE = {
    "canHandleVariableCommunicationStepSize": "true",
    "canBeInstantiatedOnlyOncePerProcess": "false",
}


@dataclass(frozen=True)
class Heading:
    """What a description says of the FMU as a whole."""

    identifier: str
    description: str
    created: str
    """Date and time by ISO 8601; empty: not known."""
    stop_time: float
    """Length of the longest identified test, s."""
    step: float
    """Shortest sampling interval of them, s."""


def model_description(contents: Contents, heading: Heading, fmi: int, sources: Sequence[str]) -> bytes:
    """The description of an FMU for co-simulation, in the words of FMI 3.0 or 2.0.

    Parameters
    ----------
    contents, heading
        The variables, and what is said of all.
    fmi
        2 or 3.
    sources
        Names of the files to compile; FMI 2.0 lists them here.
    """
    two = fmi == 2
    model = contents.model
    root = Xml.Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0" if two else "3.0",
            "modelName": writable(model.title or model.name),
            ("guid" if two else "instantiationToken"): contents.token,
            "description": writable(heading.description),
            "generationTool": f"mofit {__version__}",
            **({"generationDateAndTime": heading.created} if heading.created else {}),
            "variableNamingConvention": "structured" if contents.structured else "flat",
        },
    )
    _co_simulation(root, heading.identifier, two, sources)
    _units(root, contents)
    Xml.SubElement(Xml.SubElement(root, "LogCategories"), "Category", {"name": "logStatusError"})
    times = {"startTime": "0.0", "stopTime": repr(heading.stop_time), "tolerance": repr(TOLERANCE)}
    Xml.SubElement(root, "DefaultExperiment", {**times, "stepSize": repr(heading.step)})
    variables = Xml.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(contents.variables):
        (_scalar_variable if two else _float_variable)(variables, reference, variable)
    _structure(root, contents, two)
    return _written(root)


def _co_simulation(root: Xml.Element, identifier: str, two: bool, sources: Sequence[str]) -> None:
    known = {"modelIdentifier": identifier, **_ABLE}
    if not two:
        Xml.SubElement(
            root,
            "CoSimulation",
            {**known, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true", "maxOutputDerivativeOrder": "0"},
        )
        return
    own = {
        **known,
        "canInterpolateInputs": "true",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }
    files = Xml.SubElement(Xml.SubElement(root, "CoSimulation", own), "SourceFiles")
    for name in sources:
        Xml.SubElement(files, "File", {"name": name})


def _units(root: Xml.Element, contents: Contents) -> None:
    """Every unit once, in powers of the base units where it is a known one."""
    names = dict.fromkeys(variable.unit for variable in contents.variables if variable.unit)
    definitions = Xml.SubElement(root, "UnitDefinitions")
    for name in names:
        unit = Xml.SubElement(definitions, "Unit", {"name": name})
        try:
            factor, powers = base_units(name)
        except UnitError:
            continue
        if all(power.is_integer() for power in powers.values()):
            factors = {} if abs(factor - 1) < 1e-12 else {"factor": repr(factor)}
            Xml.SubElement(unit, "BaseUnit", {**{s: str(int(power)) for s, power in powers.items()}, **factors})


def _numbers(variable: FmuVariable) -> dict[str, str]:
    """Attributes of a real number, in the names that both versions share."""
    values = {
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
        "start": variable.start,
    }
    unit = {"unit": variable.unit} if variable.unit else {}
    return {**unit, **{name: repr(float(value)) for name, value in values.items() if value is not None}}


def _named(reference: int, variable: FmuVariable) -> dict[str, str]:
    found = {"name": variable.name, "valueReference": str(reference)}
    if variable.description:
        found["description"] = variable.description
    found |= {"causality": variable.causality, "variability": _VARIABILITY[variable.causality]}
    return found | ({"initial": _INITIAL[variable.causality]} if variable.causality in _INITIAL else {})


def _float_variable(parent: Xml.Element, reference: int, variable: FmuVariable) -> None:
    Xml.SubElement(parent, "Float64", {**_named(reference, variable), **_numbers(variable)})


def _scalar_variable(parent: Xml.Element, reference: int, variable: FmuVariable) -> None:
    scalar = Xml.SubElement(parent, "ScalarVariable", _named(reference, variable))
    Xml.SubElement(scalar, "Real", _numbers(variable))


def _structure(root: Xml.Element, contents: Contents, two: bool) -> None:
    """The outputs, each of which depends on everything."""
    structure, outputs = Xml.SubElement(root, "ModelStructure"), contents.of("output")
    if two:
        for name in ("Outputs", "InitialUnknowns"):
            group = Xml.SubElement(structure, name)
            for reference, _ in outputs:
                Xml.SubElement(group, "Unknown", {"index": str(reference + 1)})
        return
    for name in ("Output", "InitialUnknown"):
        for reference, _ in outputs:
            Xml.SubElement(structure, name, {"valueReference": str(reference)})


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    """``sources/buildDescription.xml`` of FMI 3.0: C99, and no library but that of mathematics."""
    root = Xml.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = Xml.SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    files = Xml.SubElement(configuration, "SourceFileSet", {"language": "C99"})
    for name in sources:
        Xml.SubElement(files, "SourceFile", {"name": name})
    return _written(root)


def _written(root: Xml.Element) -> bytes:
    Xml.indent(root)
    return bytes(Xml.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"
