"""NRMSD per test: the model beside its baseline and the noise floor (Hackl et al. 2016, Figure 10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.run import Run
from mofit.report.toolkit.axes import axis_of_frequencies, axis_of_tests, log_if_wide
from mofit.report.toolkit.blocks import Column, Figure, Section, Table, swatch, words
from mofit.report.toolkit.description import keyed, test_of
from mofit.report.toolkit.figures import BASELINE, FLOOR, Panels, band_key, line_key, mode_colour
from mofit.report.toolkit.formatting import compact, display_unit, number, percent


@dataclass(frozen=True)
class Errors:
    """NRMSD (fractions of the output's range) per test (and output, of several); NaN where it was not predicted."""

    tests: list[str]
    frequency: FloatArray
    noise_floor: FloatArray
    models: dict[str, FloatArray]
    baseline_title: str
    baseline: FloatArray


def extract_errors(run: Run) -> Errors:
    """NRMSD of every mode, the baseline and the noise, in the order of the tests."""
    return Errors(
        tests=run.objective_names,
        frequency=run.of_objectives("frequency"),
        noise_floor=run.of_objectives("noise_floor"),
        models={mode.name: run.of_objectives("nrmsd", mode.node) for mode in run.modes},
        baseline_title=run.baseline_title,
        baseline=run.baseline_nrmsd,
    )


def draw_errors(errors: Errors, chosen: np.ndarray, over_frequency: bool, axes: Axes) -> Axes:
    """NRMSD in % of the chosen tests, over frequency or one place per test."""
    order = np.flatnonzero(chosen)
    floor = 100 * errors.noise_floor
    if over_frequency:
        order = order[np.argsort(errors.frequency[order], kind="stable")]
        x = errors.frequency[order]
        axis_of_frequencies(axes, x)
        axes.set_xlabel("frequency (Hz)")
        axes.fill_between(x, 1e-9, floor[order], color=FLOOR, alpha=0.22, lw=0)
        axes.plot(x, floor[order], color=FLOOR, lw=1.2)
    else:
        x = axis_of_tests(axes, [errors.tests[k] for k in order])
        axes.bar(x, floor[order], width=0.8, color=FLOOR, alpha=0.3, lw=0)
    curves = [100 * nrmsd[order] for nrmsd in (*errors.models.values(), errors.baseline)]
    if np.isfinite(curves[-1]).any():
        axes.plot(x, curves[-1], color=BASELINE, ls="--" if over_frequency else "none", marker="s", ms=5)
    for k, curve in reversed([*enumerate(curves[:-1])]):
        size, width = (5.5, 1.8) if k == 0 else (4, 1.0)
        line = "-" if over_frequency else "none"
        (dots,) = axes.plot(x, curve, color=mode_colour(k), ls=line, marker="o", ms=size, lw=width)
        keyed(dots, test=[test_of(errors.tests[test]) for test in order])
    log_if_wide(axes, np.concatenate([floor[order], *curves]))
    axes.set_ylabel("NRMSD (%)")
    return axes


def errors_section(run: Run) -> Section:
    """Figure and table of the errors."""
    errors = extract_errors(run)
    return Section("errors", "Error per test", [_figure(run, errors), _table(run, errors)], {"errors": errors})


def _groups(run: Run, errors: Errors) -> list[tuple[str, np.ndarray, bool]]:
    """What a panel shows: output (of several), which tests, and whether over frequency."""
    output = np.array([one.name_of_output for one in run.objectives])
    groups = []
    for name in dict.fromkeys(output.tolist()):
        own, periodic = output == name, np.isfinite(errors.frequency)
        frequencies = errors.frequency[own & periodic]
        distinct = len(set(frequencies)) == frequencies.size > 1
        groups += [(name, own & periodic, True), (name, own & ~periodic, False)] if distinct else [(name, own, False)]
    return [group for group in groups if group[1].any()]


def _largest(errors: Errors) -> str:
    """The test with the largest error of the best mode, beside its noise floor and the baseline."""
    best = next(iter(errors.models.values()))
    if not np.isfinite(best).any():
        return ""
    k = int(np.nanargmax(best))
    floor, baseline = errors.noise_floor[k], errors.baseline[k]
    text = f"The error is largest in {errors.tests[k]}: {percent(best[k])}"
    text += f", {number(best[k] / floor)}× its noise floor" if floor > 0 else ""
    return text + (f"; {errors.baseline_title} has {percent(baseline)} there." if np.isfinite(baseline) else ".")


def _figure(run: Run, errors: Errors) -> Figure:
    groups = _groups(run, errors)
    legend = [line_key(mode_colour(k), f"model, {name}", marker="o") for k, name in enumerate(errors.models)]
    if errors.baseline_title:
        legend.append(line_key(BASELINE, errors.baseline_title, marker="s", ls="--"))
    legend.append(band_key(FLOOR, "noise floor", 0.5))
    panels = Panels(len(groups), len(groups), 2.7, legend=legend, margin=(0.65, 0.75, 0.15))
    for (output, chosen, over_frequency), axes in zip(groups, panels.axes, strict=True):
        draw_errors(errors, chosen, over_frequency, axes)
        if output:
            axes.set_title(output.replace("_", " "))
    return panels.figure(
        "NRMSD of the model, the baseline and the noise per test",
        "Root mean square of measured − simulated, divided by the measured peak-to-peak range, per test. The shaded "
        "area is the noise floor: what remains if the model is exactly right.",
        good="the model lies on the edge of the shaded area at every test, well below the baseline.",
        bad="the curve climbs away from the noise floor at one end: the model lacks an effect that matters there.",
        finding=_largest(errors),
    )


def _table(run: Run, errors: Errors) -> Table:
    best = next(iter(errors.models.values()))
    ratio = best / np.where(errors.noise_floor > 0, errors.noise_floor, np.nan)
    models: list[tuple[str, FloatArray]] = [
        (swatch(mode_colour(k), name), nrmsd) for k, (name, nrmsd) in enumerate(errors.models.items())
    ]
    if errors.baseline_title:
        models.insert(0, (errors.baseline_title, errors.baseline))
    periods = [compact(n, 4) if n > 0 else "–" for n in run.of_objectives("periods")]
    tests = [one.name_of_test for one in run.objectives]
    amplitudes = zip(tests, run.of_objectives("amplitude"), strict=True)
    columns = [
        Column("Test", errors.tests),
        words("Excitation", [run.excitations[one.test].replace("_", " ") for one in run.objectives]),
        Column("Frequency (Hz)", [compact(hertz, 4) for hertz in errors.frequency]),
        Column("Amplitude", [_amplitude(run, *row) for row in amplitudes]),
        Column("Periods", periods),
        Column("Noise floor", [percent(floor) for floor in errors.noise_floor]),
        *(Column(head, [percent(value) for value in nrmsd]) for head, nrmsd in models),
        Column("Model / floor", [f"{number(value)}×" if np.isfinite(value) else "–" for value in ratio]),
    ]
    return Table(columns, "NRMSD per test. “Model / floor” compares the best mode with the noise floor.")


def _amplitude(run: Run, test: str, value: float) -> str:
    """Amplitude of the input in its display unit: tests of one campaign may excite different channels."""
    source = run.input_of(test)
    units = source.attrs["units"] if source is not None else run.tree.dataset["amplitude"].attrs["units"]
    unit = display_unit(str(units), value)
    return f"{compact(unit.factor * value, 4)} {unit.name}" if np.isfinite(value) else "–"
