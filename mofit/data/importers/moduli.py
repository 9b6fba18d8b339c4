"""Tables of dynamic moduli (DMA): every row becomes a sine test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mofit.data.campaign import Measurement
from mofit.data.dma import sine_tests
from mofit.data.importers.import_map import ColumnMap, ModuliMap, TestMap
from mofit.data.importers.record import read_column, read_conditions
from mofit.data.importers.table import Table
from mofit.data.names import shown
from mofit.errors import InputError, Issue, raise_errors

#: input and output of the tests, by the SI unit of the moduli
_CHANNELS = {"Pa": ("strain", "stress"), "N/m": ("displacement", "force"), "N/m^2": ("strain", "stress")}


def moduli_tests(test: TestMap, moduli: ModuliMap, table: Table, shared: Mapping[str, float]) -> list[Measurement]:
    """A sine test per row (`mofit.data.dma.sine_tests`), named ``<test>_<row>``; ``shared`` are the conditions of all.

    Raises
    ------
    InputError
        If a column is missing or has no fitting unit, or a row has a value that is not positive.
    """
    where = f"test '{shown(test.name)}'"
    issues: list[Issue] = []
    fixed = {name: value for name, value in test.conditions.items() if not isinstance(value, ColumnMap)}
    conditions, _ = read_conditions(where, fixed, issues)
    raise_errors(issues)
    names = ("frequency", "storage", "loss")
    (frequency, storage, loss), units = zip(
        *(read_column(test, "moduli", getattr(moduli, name), name, table) for name in names), strict=True
    )
    if units[0] != "Hz" or units[1] != units[2] or units[1] not in _CHANNELS:
        what = f"frequency, storage and loss in {', '.join(units)}"
        raise InputError.of(where, what, "Give Hz, and for both moduli a unit of stress (MPa) or of stiffness (N/mm)")
    for name, values in zip(names, (frequency, storage, loss), strict=True):
        if bad := np.flatnonzero(~(np.isfinite(values) & (values > 0))).tolist():
            issues.append(Issue(f"{where}, {name}", f"row {bad[0] + 1} is not positive", "Correct it, or set rows"))
    raise_errors(issues)
    deviation = moduli.deviation * np.hypot(storage, loss)
    labels = [f"{test.name}_{row}" for row in range(1, len(frequency) + 1)]
    made = sine_tests(frequency, storage, loss, deviation, channels=_CHANNELS[units[1]], names=labels).measurements
    temperatures: list[dict[str, float]] = [{}] * len(made)
    if moduli.temperature is not None:
        values, _ = read_column(test, "moduli", moduli.temperature, "temperature", table)
        temperatures = [{"temperature": float(value)} for value in values]
    return [
        replace(
            one,
            experiment=replace(one.experiment, conditions={**shared, **conditions, **temperature}),
            history="made of dynamic moduli, not recorded",
        )
        for one, temperature in zip(made, temperatures, strict=True)
    ]
