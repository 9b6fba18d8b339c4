"""The page and the pictures of relaxation lengths and frequency responses."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np

from mofit.models import Condition
from mofit.prediction.relaxation import FREQUENCIES, SPEED, OperatingPoint, TyreResponses
from mofit.quantities import CONDITIONS
from mofit.report.toolkit.axes import log_axis
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, method_section, words
from mofit.report.toolkit.figures import Panels, as_written, band_key, line_key, mode_colour, styled
from mofit.report.toolkit.formatting import number
from mofit.report.toolkit.page import draw_sections, write_page

#: conditions that get panels of their own; the others are in the file of numbers
_MOST = 8


def write_relaxation_page(responses: TyreResponses, title: str, path: Path) -> Path:
    """Write one self-contained page: the table of relaxation lengths, the Bode plots, and how both are defined."""
    sections = draw_sections((_lengths, _bode, _method), responses)
    return write_page(path, f"Relaxation of {title}", "5, 50 and 95 % quantiles", sections)


def save_bode(responses: TyreResponses, path: Path, kind: str) -> None:
    """The Bode plots as a picture, ``svg`` or ``png``."""
    with styled():
        panels = _panels(responses)
        as_written(panels.canvas)
        panels.canvas.savefig(path, format=kind, dpi=144)


def _shown(responses: TyreResponses) -> list[Condition]:
    """Conditions that name an operating point: the speed, and the known ones that differ between the points."""

    def differs(name: str) -> bool:
        return len({point.conditions[name] for point in responses.points}) > 1

    own = responses.model.conditions
    return [c for c in own if c.name == SPEED or (c.name in CONDITIONS and differs(c.name))]


def _slip(point: OperatingPoint) -> str:
    return f"{np.degrees(point.slip):.3g}°" if point.source == "slip_angle" else f"{100 * point.slip:.3g} %"


def _lengths(responses: TyreResponses) -> Section:
    blocks: list[Block] = []
    together = list(zip(responses.points, responses.lengths(), strict=True))
    for (source, output), group in groupby(together, lambda entry: (entry[0].source, entry[0].output)):
        rows = list(group)
        columns = [words(source.replace("_", " "), [_slip(point) for point, _ in rows])]
        columns += [
            Column(f"{c.name.replace('_', ' ')} ({c.unit})", [number(point.conditions[c.name]) for point, _ in rows])
            for c in _shown(responses)
        ]
        for definition in rows[0][1]:
            values = [lengths[definition] for _, lengths in rows]
            cells = [f"{number(v[1])} ({number(v[0])} to {number(v[2])})" for v in values]
            columns.append(Column(f"{definition} (m)", cells))
        blocks.append(Table(columns, f"Relaxation length of the {output.replace('_', ' ')}: median (5 to 95 %)."))
    return Section("lengths", "Relaxation lengths", blocks)


def _panels(responses: TyreResponses) -> Panels:
    found = list(responses.bode())[:_MOST]
    colour = mode_colour(0)
    legend = [line_key(colour, "median"), band_key(colour, "5 to 95 %")]
    panels = Panels(
        len(found), min(len(found), 2), 1.6, legend=legend, lower=1.0, margin=(0.9, 0.5, 0.1), gap=(0.75, 0.7)
    )
    for (point, gain, phase), axes, lower in zip(found, panels.axes, panels.lower, strict=True):
        for panel, values in ((axes, gain), (lower, phase)):
            panel.fill_between(FREQUENCIES, values[0], values[2], color=colour, alpha=0.4, lw=0)
            panel.plot(FREQUENCIES, values[1], color=colour)
            log_axis(panel, "x")
        own = [f"{point.conditions[c.name]:.4g} {c.unit}" for c in _shown(responses)]
        axes.set_title(f"{point.output.replace('_', ' ')} / {point.source.replace('_', ' ')} at {', '.join(own)}")
    units = " or ".join(dict.fromkeys(_gain_unit(responses, point) for point, _, _ in found))
    panels.label("frequency (Hz)", f"gain ({units})", "phase (°)")
    return panels


def _gain_unit(responses: TyreResponses, point: OperatingPoint) -> str:
    """Unit of the output over that of the slip."""
    model = responses.model
    units = {channel.name: channel.unit for channel in (*model.inputs, *model.outputs)}
    output, slip = units[point.output], units[point.source]
    return output if slip == "1" else f"{output}/{slip}"


def _bode(responses: TyreResponses) -> Section:
    figure: Figure = _panels(responses).figure(
        "Gain and phase over frequency with their bands",
        "Output over slip, linearised at zero slip: gain above, phase below.",
        good="a narrow band up to the highest frequency that was tested.",
        bad="a band that opens beyond the tested frequencies: there the model extrapolates.",
    )
    return Section("bode", "Frequency response", [figure])


def _method(_: TyreResponses) -> Section:
    steps = {
        "Linearisation": "The model with each of its posterior draws is linearised at rest under a constant slip.",
        "Low frequency": "The slope of the phase at frequency 0 times the speed: what a slow slip lags behind, as a "
        "length. At zero slip that is slip stiffness over carcass stiffness.",
        "63 % step response": "The way after a small step of the slip until the force has made 63.2 % of its change.",
    }
    return method_section(steps)
