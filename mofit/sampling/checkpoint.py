"""Checkpoints: every chain of a run in one HDF5 file that emcee can open, replaced whole or not at all."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.runtime.files import atomic_path
from mofit.sampling.bend import Bend
from mofit.sampling.ensemble import Ensemble
from mofit.sampling.independence_proposal import StudentTMixture
from mofit.sampling.state import Run

if TYPE_CHECKING:
    import h5py

#: attributes of a mode's group, in `Run`
_FACTS: dict[str, Callable[[Any], Any]] = {
    "time": float, "rounds": int, "burned": int, "level": float, "settled": bool, "producing": bool,
    "tau": np.asarray, "refits": int, "evaluations": int,
}  # fmt: skip
#: data sets of its proposal, in `StudentTMixture`
_PROPOSAL = ("weights", "means", "scales", "freedom")
#: those of its bend, if it has one, in `Bend`
_BEND = ("centre", "axes", "terms")
#: data sets of an ensemble's group, as emcee's HDFBackend names them, and their names in `Ensemble`
_ARRAYS = {
    "accepted": "accepted",
    "chain": "chain",
    "log_prob": "chain_log_prob",
    "positions": "positions",
    "positions_log_prob": "log_prob",
}


@dataclass
class Checkpoints:
    """Saves the run of a mode as it grows: at once, then every so many seconds, and at the end.

    Each ensemble is a group ``<mode>/ensemble<k>`` in the layout of `emcee.backends.HDFBackend`; the attributes of
    ``<mode>`` hold what else a continuation needs.

    Parameters
    ----------
    path
        The file; other modes in it are kept. None keeps nothing.
    mode
        Group of the mode, e.g. ``"m1"``.
    origin
        What the numbers depend on (seed, settings ...). A stored mode is only continued if it agrees.
    centre
        The minimum that the mode was started from, shape (d,).
    seconds
        Least time between two checkpoints.
    saved, time
        What was saved last (or loaded), and when.
    """

    path: Path | None
    mode: str
    origin: Mapping[str, object]
    centre: FloatArray
    seconds: float
    saved: Run | None = None
    time: float = -math.inf

    def save(self, run: Run, last: bool = False) -> Run:
        """The same run, saved if it is time: a new file, flushed to disk, takes the place of the old one."""
        if self.path is None or run is self.saved or not (last or monotonic() - self.time >= self.seconds):
            return run
        import h5py  # late: only who samples needs it

        # in memory first: on a full disk HDF5 cannot close its file, and ends the process
        with h5py.File(self.path.name, "w", driver="core", backing_store=False) as new:
            if self.path.exists():
                with h5py.File(self.path, "r") as old:
                    for name in old:
                        if name != self.mode:
                            old.copy(name, new)
            self._write(new.create_group(self.mode), run)
            new.flush()
            image = new.id.get_file_image()
        with atomic_path(self.path) as temporary:
            temporary.write_bytes(image)
        self.saved, self.time = run, monotonic()
        return run

    def load(self) -> Run | None:
        """The stored state of the mode, or None if there is none.

        Raises
        ------
        InputError
            If the file is no HDF5 file, or holds this mode from another seed, other settings or another start.
        """
        if self.path is None or not self.path.exists():
            return None
        import h5py

        try:
            file = h5py.File(self.path, "r")
        except OSError as error:
            raise self._damaged(error) from error
        with file:
            try:
                return self._loaded(file)
            except (KeyError, OSError, RuntimeError, ValueError, TypeError) as error:
                raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> InputError:
        return InputError.of(f"file '{self.path}'", f"cannot be read: {error}", "Remove it to sample afresh")

    def _loaded(self, file: h5py.File) -> Run | None:
        if self.mode in file:
            group = file[self.mode]
            centre = np.asarray(group.attrs["centre"])
            same_start = centre.shape == self.centre.shape and np.allclose(centre, self.centre, atol=1e-6)
            if group.attrs["origin"] != _canonical(self.origin) or not same_start:
                raise InputError.of(
                    f"file '{self.path}', mode '{self.mode}'",
                    "it was sampled with another seed, other settings or from another minimum",
                    "Repeat the first run's command, or remove the file to start afresh",
                )
            self.saved = _read(group)
        return self.saved

    def _write(self, group: h5py.Group, run: Run) -> None:
        group.attrs["origin"] = _canonical(self.origin)
        group.attrs["centre"] = self.centre
        for name in _PROPOSAL:
            group[f"proposal/{name}"] = getattr(run.proposal, name)
        if run.proposal.bend is not None:
            for name in _BEND:
                group[f"proposal/bend/{name}"] = getattr(run.proposal.bend, name)
        for name in _FACTS:
            group.attrs[name] = getattr(run, name)
        for number, ensemble in enumerate(run.ensembles):
            _write_ensemble(group.create_group(f"ensemble{number}"), ensemble)


def _canonical(facts: Mapping[str, object]) -> str:
    return json.dumps(facts, sort_keys=True, default=str)


def _write_ensemble(group: h5py.Group, ensemble: Ensemble) -> None:
    import emcee  # late: it imports scipy.stats, which takes half a second

    group.attrs["version"] = emcee.__version__
    group.attrs["nwalkers"], group.attrs["ndim"] = ensemble.positions.shape
    group.attrs["has_blobs"] = False
    group.attrs["iteration"] = len(ensemble.chain)
    for number, part in enumerate(ensemble.random_state):
        group.attrs[f"random_state_{number}"] = part
    for name, own in _ARRAYS.items():
        group[name] = getattr(ensemble, own)


def _read(group: h5py.Group) -> Run:
    names = sorted((name for name in group if name.startswith("ensemble")), key=lambda name: int(name[8:]))
    stored = group["proposal"]
    bend = Bend(**{name: stored[f"bend/{name}"][()] for name in _BEND}) if "bend" in stored else None
    return Run(
        ensembles=tuple(_read_ensemble(group[name]) for name in names),
        proposal=StudentTMixture(**{name: stored[name][()] for name in _PROPOSAL}, bend=bend),
        **{name: kind(group.attrs[name]) for name, kind in _FACTS.items()},
    )


def _read_ensemble(group: h5py.Group) -> Ensemble:
    count = sum(name.startswith("random_state_") for name in group.attrs)
    return Ensemble(
        random_state=tuple(group.attrs[f"random_state_{number}"] for number in range(count)),
        **{own: group[name][...] for name, own in _ARRAYS.items()},
    )
