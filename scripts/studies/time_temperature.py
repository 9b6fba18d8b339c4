"""Temperature as a condition: shift factors of a polymer. Writes reports/conditions/time_temperature.md.

    python scripts/studies/time_temperature.py [--data FOLDER] [--work FOLDER] [--seed 0] [--redo]

Measured: nrel_dma, storage and loss modulus of a polymer at ten frequencies and 21 temperatures (the temperature of a
sweep is the mean of its rows). The model is `havriliak_negami_solid`; tau follows the temperature, all else is shared
(`--over temperature --law tau=wlf,arrhenius,free --law others=shared`). log10 a_T = log10 tau(T) / tau(T_0) is shown
with its standard deviation, of every temperature by itself (free) and by the law with the most evidence. Beside it:
the shift of the storage moduli of neighbouring sweeps onto each other, without any model. Standard deviations hold for
the model's shape of the relaxation; overlap, which assumes none, differs by more where the moduli are flat. One of
several decades means that tau lies at an end of its range.

The published shift factors do not belong to these sweeps but to another specimen, whose master curve is published with
them: at -5 degC and 1.6 Hz that has 0.4 GPa, the sweeps have 7.5 GPa. So the published master curve is taken apart
again with the published factors, into ten frequencies from 0.1 to 100 Hz per temperature (linear interpolation on log
scales), and identified without them. Above 25 degC that curve is a plateau of 0.1 GPa with 3 % of scatter: it holds no
shift factors there.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, import_files
from mofit.data.dma import sine_tests
from mofit.identification.conditions import study_conditions
from mofit.identification.law_fit import CellEstimates, fit_laws
from mofit.identification.settings import Settings
from mofit.models import find_model, values_under
from report_page import ROOT, header, made_with, table, write_page

MODEL, CELSIUS, MEGA = "havriliak_negami_solid", 273.15, 1e6
FORMS = ("wlf", "arrhenius", "free")
#: relative scatter of the published master curve
SCATTER = 0.03
#: evaluations of the search; each finds the relaxation times of all temperatures
SEARCH = 400
#: J / (mol K)
GAS = 8.314462618
#: name, title, whether of the published master curve, range of temperatures in degC
PARTS = (
    ("rubber", "Sweeps above the glass transition, 47 to 100 °C", False, (45.0, 105.0)),
    ("glass", "Sweeps below it, -20 to 40 °C", False, (-25.0, 45.0)),
    ("master", "Published master curve taken apart, -50 to 25 °C", True, (-55.0, 28.0)),
    ("raw", "Sweeps from -20 to 100 °C", False, (-25.0, 105.0)),
)


def read(file: Path) -> FloatArray:
    """Columns of a table of two header lines."""
    return np.genfromtxt(file, delimiter=",", skip_header=2).T


def sweeps(folder: Path, limits: tuple[float, float]) -> Campaign:
    """The measured sweeps between two temperatures, each under its mean temperature."""
    campaign = import_files([folder], ROOT / "data" / "maps" / "nrel_dma.toml")
    _, _, _, temperature, number = read(folder / "freq_user_raw.csv")
    means = {k: float(temperature[number == k].mean()) for k in np.unique(number)}
    found = [
        replace(one, experiment=replace(one.experiment, conditions={"temperature": round(means[k] + CELSIUS, 2)}))
        for one, k in zip(campaign.measurements, number, strict=True)
        if limits[0] < means[k] < limits[1]
    ]
    return replace(campaign, measurements=tuple(found))


def published(folder: Path) -> tuple[FloatArray, FloatArray]:
    """Temperatures in degC, ascending, and published log10 of the shift factors."""
    found = read(folder / "freq_user_master__shift_factors.csv")[:, ::-1]
    return found[0], found[1]


def taken_apart(folder: Path, limits: tuple[float, float]) -> Campaign:
    """Ten frequencies per temperature of the published master curve."""
    reduced, storage, loss = read(folder / "freq_user_master.csv")
    frequency, measurements = np.geomspace(0.1, 100, 10), []
    for number, (celsius, shift) in enumerate(zip(*published(folder), strict=True)):
        if not limits[0] < celsius < limits[1]:
            continue
        at = np.log10(frequency) + shift
        own = [MEGA * np.exp(np.interp(at, np.log10(reduced), np.log(one))) for one in (storage, loss)]
        sd = SCATTER * np.hypot(*own)
        names = [f"{celsius:g}C_{one:.3g}Hz" for one in frequency]
        made = sine_tests(frequency, own[0], own[1], sd, channels=("strain", "stress"), names=names, seed=number)
        measurements += [
            replace(one, experiment=replace(one.experiment, conditions={"temperature": celsius + CELSIUS}))
            for one in made.measurements
        ]
    return Campaign("published master curve, taken apart", "measured", {}, tuple(measurements))


def overlap(folder: Path, temperatures: Sequence[float]) -> list[float]:
    """log10 of the shift factors from the storage moduli of neighbouring sweeps, a parabola through each, in kelvin."""
    frequency, storage, _, temperature, number = read(folder / "freq_user_raw.csv")
    tried, found = np.linspace(0, 4, 801), [0.0]
    sets = [
        k for k in np.unique(number) if np.min(np.abs(temperature[number == k].mean() + CELSIUS - temperatures)) < 1
    ]
    for cold, warm in pairwise(sets):
        own, other = (np.log(storage[number == k]) for k in (cold, warm))
        log = np.log10(frequency[number == cold])
        curve, errors = np.polyfit(log, own, 3), []
        for shift in tried:
            inside = (log - shift >= log[0]) & (log - shift <= log[-1])
            rest = np.polyval(curve, log[inside] - shift) - other[inside]
            errors.append(np.mean(rest**2) if inside.sum() > 1 else np.inf)
        found.append(found[-1] - float(tried[np.argmin(errors)]))
    return found


def relative(cells: CellEstimates, k: int, reference: int) -> tuple[FloatArray, FloatArray]:
    """log10 of the shift factors of every temperature by itself, and their standard deviation."""
    shared = [j for j, one in enumerate(cells.parameters) if one.name in cells.shared]
    count, own = len(cells.at), len(shared)
    whole = np.zeros((own + count, own + count))
    for g, part in enumerate(cells.precision):
        place = [*range(own), own + g]
        whole[np.ix_(place, place)] += part[np.ix_([*shared, k], [*shared, k])]
    covariance = np.linalg.inv(whole)[own:, own:]
    variance = np.diag(covariance) + covariance[reference, reference] - 2 * covariance[reference]
    z = cells.z[:, k] - cells.z[reference, k]
    return z / np.log(10), np.sqrt(np.maximum(variance, 0)) / np.log(10)


def identified(campaign: Campaign, seed: int, fixed: Mapping[str, float]) -> dict[str, Any]:
    """Evidence and shift factors."""
    began = time.process_time()
    laws = {"tau": ",".join(FORMS), "others": "shared"}
    settings = Settings(
        over=("temperature",), laws=laws, fixed=fixed, sample=False, jobs=1, evaluations=SEARCH, seed=seed
    )
    study = study_conditions(campaign, find_model(MODEL), settings)
    cells, key = study.cells, ("tau", "temperature")
    k = [one.name for one in cells.parameters].index("tau")
    reference = int(np.argmin(np.abs(cells.at[:, 0] - (CELSIUS - 5))))
    free, sd = relative(cells, k, reference)
    fits = {form: fit_laws(cells, {**study.fit.forms, key: form}, study.fit.values) for form in FORMS}
    best = max(FORMS[:2], key=lambda form: fits[form].log_evidence)
    values, law = fits[best].values, fits[best].laws[0]
    at = np.log10(values_under(cells.parameters[k], fits[best].laws, values, {"temperature": cells.at[:, 0]}))
    return {
        "celsius": (cells.at[:, 0] - CELSIUS).tolist(),
        "reference": reference,
        "free": free.tolist(),
        "sd": sd.tolist(),
        "law": best,
        "by_law": (at - at[reference]).tolist(),
        "evidence": {form: fits[form].log_evidence - fits["free"].log_evidence for form in FORMS},
        "chi_square": {form: [fits[form].chi_square, fits[form].freedom] for form in FORMS},
        "constants": constants(values, law.centre, law.half_range),
        "shared": {
            name: [float(cells.values[0, j]), float(cells.sd[0, j]), cells.parameters[j].unit]
            for j, name in enumerate(one.name for one in cells.parameters)
            if name in cells.shared
        },
        "seconds": time.process_time() - began,
    }


def constants(values: Mapping[str, float], centre: float, half: float) -> str:
    """C1 and C2 at the middle, or the activation energy."""
    slope = values["tau_temperature"]
    if "tau_temperature_2" not in values:
        return f"activation energy {GAS * slope / 1e3:.0f} kJ/mol"
    curvature = values["tau_temperature_2"]
    if curvature <= 0:
        return "C₂ infinite"
    second = half / curvature
    return f"C₁ = {-slope * second / half / np.log(10):.1f}, C₂ = {second:.0f} K at {centre - CELSIUS:.0f} °C"


def section(title: str, row: Mapping[str, Any], head: str, beside: Sequence[float]) -> list[str]:
    """A table of one campaign."""
    lines = [f"## {title}", ""]
    lines += table(
        ("law of tau", "log evidence over free", "chi square", "to spare"),
        [(form, f"{row['evidence'][form]:.1f}", *(f"{v:.4g}" for v in row["chi_square"][form])) for form in FORMS],
    )
    best = max(row["evidence"], key=row["evidence"].get)
    lines += [f"Most evidence: {best}. Best of WLF and Arrhenius: {row['law']}, {row['constants']}.", ""]
    beside = np.array(beside) - beside[row["reference"]]
    columns = zip(row["celsius"], row["free"], row["sd"], row["by_law"], beside, strict=True)
    heads = ("T, °C", "log a_T, free", "sd", f"log a_T, {row['law']}", head)
    lines += table(heads, [(f"{t:.0f}", f"{f:.2f}", f"{s:.2f}", f"{w:.2f}", f"{b:.2f}") for t, f, s, w, b in columns])
    lines += table(
        ("shared parameter", "value", "sd", "unit"),
        [(name, f"{v:.4g}", f"{s:.2g}", unit) for name, (v, s, unit) in row["shared"].items()],
    )
    return [*lines, f"Processor time: {row['seconds']:.0f} s.", ""]


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "time_temperature")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--redo", action="store_true")
    options = parser.parse_args()
    if options.redo:
        shutil.rmtree(options.work, ignore_errors=True)
    options.work.mkdir(parents=True, exist_ok=True)
    folder, lines = options.data / "nrel_dma", []
    for name, title, of_master, limits in PARTS:
        file = options.work / f"{name}.json"
        if not file.exists():
            campaign = taken_apart(folder, limits) if of_master else sweeps(folder, limits)
            found = identified(campaign, options.seed, {"tau_d": 0.0} if of_master else {})
            file.write_text(json.dumps(found), encoding="utf-8")
        row = json.loads(file.read_text(encoding="utf-8"))
        at, shift = published(folder)
        kelvin = [celsius + CELSIUS for celsius in row["celsius"]]
        beside = [float(np.interp(t, at, shift)) for t in row["celsius"]] if of_master else overlap(folder, kelvin)
        lines += section(title, row, "published" if of_master else "by overlap", beside)
        command = f"time_temperature.py --seed {options.seed}"
        head = header("Time-temperature superposition", __doc__, command, made_with())
        write_page("conditions", [*head, *lines], "time_temperature.md")


if __name__ == "__main__":
    main()
