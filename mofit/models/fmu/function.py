"""An FMU as a function of a record and parameters; its native code is loaded with the first call."""

from __future__ import annotations

import os
import stat
import tempfile
import weakref
from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.models.black_box import Record
from mofit.models.fmu.co_simulation import co_simulate
from mofit.models.fmu.description import CO_SIMULATION, FmuDescription, fmpy_for
from mofit.models.fmu.mapping import FmuMapping
from mofit.models.fmu.model_exchange import exchange
from mofit.models.fmu.sensitivities import sensitivities
from mofit.models.simulator_call import Response, call_simulator
from mofit.runtime.isolated import Call, IsolatedProcess
from mofit.runtime.isolated_server import in_child
from mofit.runtime.sending import sendable

#: Samples that a reset instance must repeat before resets are trusted, and how well. It simulates as many more: the
#: curve of an input depends on the samples behind.
_REPEATED, _ALIKE = 20, 1e-6
#: Seconds that a simulation may take in the function's own process.
_PATIENCE = 60.0


class FmuFunction:
    """``function(record, parameters)``: outputs of an FMU over time, by name. It pickles without its instance.

    An FMU is native code: it is loaded by a process that may crash (`mofit.runtime.isolated`). Where this is not one,
    the function has one of its own. The instance is kept and reset between calls if a reset makes the FMU repeat
    itself; of one that it does not, each call takes a new instance.

    Parameters
    ----------
    path
        The FMU.
    mapping
        Its variables under mofit's names.

    Attributes
    ----------
    fingerprint
        Changes with the content of the file and with the mapping.
    """

    #: imported once for all children of a process: FMPy takes longer to import than a child to fork
    preload = ("fmpy.simulation", "fmpy.fmi2", "fmpy.fmi3", "lxml.etree", __name__)

    def __init__(self, path: Path, mapping: FmuMapping) -> None:
        self.path, self.mapping = path.resolve(), mapping
        self.fingerprint = sha256(path.read_bytes() + repr(mapping).encode()).hexdigest()
        self._instance: Instance | None = None
        self._process: IsolatedProcess | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Without what belongs to this process."""
        return {**vars(self), "_instance": None, "_process": None}

    def __call__(self, record: Record, parameters: Mapping[str, float]) -> dict[str, FloatArray]:
        """Outputs by name, (n,) each, in SI units.

        Raises
        ------
        RuntimeError
            If the FMU crashes, hangs, or answers nan.
        """
        values = (
            self._here().simulated(record, parameters) if in_child() else self._elsewhere(record, parameters).outputs
        )
        assert values is not None
        return {port.name: values[:, k] for k, port in enumerate(self.mapping.outputs)}

    def _here(self) -> Instance:
        if self._instance is None:
            self._instance = Instance(self.path, self.mapping, self.fingerprint)
        return self._instance

    def _elsewhere(self, record: Record, parameters: Mapping[str, float], free: tuple[str, ...] = ()) -> Response:
        """What the function's own process answers."""
        if self._process is None:
            self._process = IsolatedProcess((call_simulator.__module__, *self.preload))
            weakref.finalize(self, self._process.close)
        outputs = tuple(port.name for port in self.mapping.outputs)
        call = Call(
            call_simulator,
            (sendable(self, f"FMU '{self.path}'"), sendable(record, f"test '{record.name}'")),
            (dict(parameters), outputs, free),
        )
        (answer,) = self._process.answers([call], _PATIENCE)
        response = Response(None, None, answer.failure) if answer.failure else Response(*answer.value)
        if response.outputs is None:
            raise RuntimeError(f"the FMU failed: {response.failure}")
        return response


class DerivingFmuFunction(FmuFunction):
    """An FMU for model exchange with directional derivatives: it offers the sensitivities of its outputs."""

    def sensitivities(
        self, record: Record, parameters: Mapping[str, float], free: tuple[str, ...]
    ) -> tuple[FloatArray, FloatArray | None]:
        """Outputs (n, ny) and their derivatives (n, ny, nf) by free parameters, in SI units.

        Raises
        ------
        RuntimeError
            If the FMU crashes, hangs, or answers nan.
        """
        if in_child():
            return self._here().sensitivities(record, parameters, free)
        response = self._elsewhere(record, parameters, free)
        assert response.outputs is not None
        return response.outputs, response.slopes


def fmu_function(found: FmuDescription, mapping: FmuMapping) -> FmuFunction:
    """The function of an FMU, with sensitivities where it can give them."""
    derives = found.derives and mapping.interface != CO_SIMULATION
    return (DerivingFmuFunction if derives else FmuFunction)(found.path, mapping)


class Instance:
    """An FMU that is loaded in this process."""

    def __init__(self, path: Path, mapping: FmuMapping, fingerprint: str) -> None:
        self.mapping = mapping
        self.fmpy = fmpy_for(f"FMU '{path}'")
        self.folder = _unpacked(self.fmpy, path, fingerprint)
        self.description = self.fmpy.read_model_description(self.folder, validate=False)
        self.fmu: Any = None
        self.resets: bool | None = None
        """Whether a reset instance repeats what a new one does; None before that is known."""

    def simulated(self, record: Record, parameters: Mapping[str, float]) -> FloatArray:
        """Outputs (n, ny) in SI units."""
        found = self._run(record, parameters)
        if self.resets is None:
            self.resets = self._repeats(record, parameters, found)
        return found

    def sensitivities(
        self, record: Record, parameters: Mapping[str, float], free: tuple[str, ...]
    ) -> tuple[FloatArray, FloatArray]:
        """Outputs (n, ny) and derivatives (n, ny, nf), in SI units."""
        found = self.simulated(record, parameters)
        slopes = sensitivities(self.fresh, self.description, self.mapping, record, parameters, free)
        return found, slopes if slopes is not None else self._differences(record, parameters, free)

    def fresh(self) -> Any:
        """The FMU, ready to be initialised."""
        if self.fmu is not None and self.resets is not False:
            try:
                self.fmu.reset()
                return self.fmu
            except Exception:  # noqa: BLE001  an FMU that cannot is made anew
                self.resets = False
        self.free()
        kind = "CoSimulation" if self.mapping.interface == CO_SIMULATION else "ModelExchange"
        self.fmu = self.fmpy.instantiate_fmu(self.folder, self.description, kind, require_functions=False)
        return self.fmu

    def free(self) -> None:
        """Give the FMU's memory back."""
        fmu, self.fmu = self.fmu, None
        if fmu is not None:
            fmu.freeInstance()

    def _run(self, record: Record, parameters: Mapping[str, float]) -> FloatArray:
        simulate = co_simulate if self.mapping.interface == CO_SIMULATION else exchange
        try:
            return simulate(self.fresh(), self.description, self.folder, self.mapping, record, parameters)
        except Exception:
            self.free()  # after an error its state is anything
            raise

    def _repeats(self, record: Record, parameters: Mapping[str, float], found: FloatArray) -> bool:
        """Whether the instance, once reset, repeats the first samples."""
        n = min(2 * _REPEATED, len(record.time))
        start = replace(record, time=record.time[:n], inputs={name: one[:n] for name, one in record.inputs.items()})
        try:
            again = self._run(start, parameters)
        except Exception:  # noqa: BLE001  the first run was fine: it is the reset that is not
            return False
        size = np.ptp(found, axis=0) + np.abs(found).max(axis=0)
        return bool(np.all(np.abs(again - found[:n])[:_REPEATED] <= _ALIKE * size))

    def _differences(self, record: Record, parameters: Mapping[str, float], free: tuple[str, ...]) -> FloatArray:
        """Central differences, (n, ny, nf), with steps of the third root of the integration's tolerance."""
        columns = []
        for name in free:
            step = self.mapping.tolerance ** (1 / 3) * (abs(parameters[name]) or 1.0)
            ends = [self._run(record, {**parameters, name: parameters[name] + side * step}) for side in (1, -1)]
            columns.append((ends[0] - ends[1]) / (2 * step))
        return np.stack(columns, axis=-1)


def _unpacked(fmpy: Any, path: Path, fingerprint: str) -> str:
    """Folder with the unpacked FMU, shared by the children of one process where nobody else can write to it."""
    root = Path(tempfile.gettempdir())
    status = root.stat()
    private = status.st_uid == os.getuid() and stat.S_IMODE(status.st_mode) == stat.S_IRWXU
    folder = root / fingerprint if private else Path(tempfile.mkdtemp(prefix="mofit-")) / fingerprint
    if not folder.is_dir():
        part = tempfile.mkdtemp(dir=folder.parent)
        fmpy.extract(str(path), part)
        Path(part).rename(folder)
    return str(folder)
