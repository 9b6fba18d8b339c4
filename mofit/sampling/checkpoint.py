"""Checkpoints: every chain of a run in one HDF5 file that emcee can open, replaced whole or not at all."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import h5py
import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.runtime.files import atomic_path
from mofit.sampling.ensemble import Ensemble
from mofit.sampling.independence_proposal import StudentTMixture
from mofit.sampling.state import Run


@dataclass(frozen=True)
class Store:
    """A place for one mode in a file of chains.

    Each ensemble is a group ``<mode>/ensemble<k>`` in the layout of `emcee.backends.HDFBackend`; the attributes of
    ``<mode>`` hold what else a continuation needs.

    Parameters
    ----------
    path
        The file; other modes in it are kept.
    mode
        Group of the mode, e.g. ``"m1"``.
    origin
        What the numbers depend on (seed, settings ...), as JSON. A stored mode is only continued if it agrees.
    centre
        The minimum that the mode was started from, shape (d,).
    """

    path: Path
    mode: str
    origin: str
    centre: FloatArray

    def save(self, run: Run) -> None:
        """Write the mode, keeping the others: a new file, flushed to disk, takes the place of the old one."""
        with atomic_path(self.path) as temporary, h5py.File(temporary, "w") as new:
            if self.path.exists():
                with h5py.File(self.path, "r") as old:
                    for name in old:
                        if name != self.mode:
                            old.copy(name, new)
            self._write(new.create_group(self.mode), run)

    def load(self) -> Run | None:
        """The stored state of the mode, or None if there is none.

        Raises
        ------
        InputError
            If the file is no HDF5 file, or holds this mode from another seed, other settings or another start.
        """
        if not self.path.exists():
            return None
        try:
            file = h5py.File(self.path, "r")
        except OSError as error:
            raise InputError.of(
                f"file '{self.path}'", f"cannot be read: {error}", "Remove it to start afresh"
            ) from error
        with file:
            if self.mode not in file:
                return None
            group = file[self.mode]
            centre = np.asarray(group.attrs["centre"])
            same_start = centre.shape == self.centre.shape and np.allclose(centre, self.centre, atol=1e-6)
            if group.attrs["origin"] != self.origin or not same_start:
                raise InputError.of(
                    f"file '{self.path}', mode '{self.mode}'",
                    "it was sampled with another seed, other settings or from another minimum",
                    "Repeat the first run's command, or remove the file to start afresh",
                )
            return _read(group)

    def _write(self, group: h5py.Group, run: Run) -> None:
        group.attrs["origin"] = self.origin
        group.attrs["centre"] = self.centre
        for name in ("weights", "means", "scales", "freedom"):
            group[f"proposal/{name}"] = getattr(run.proposal, name)
        for name in ("time", "rounds", "burned", "level", "settled", "producing", "tau", "evaluations"):
            group.attrs[name] = getattr(run, name)
        for number, ensemble in enumerate(run.ensembles):
            _write_ensemble(group.create_group(f"ensemble{number}"), ensemble)


@dataclass
class Checkpoints:
    """Saves a run as it grows: at once, then every so many seconds, and at the end.

    Parameters
    ----------
    store
        Where; None keeps nothing.
    seconds
        Least time between two checkpoints.
    saved, time
        What was saved last (or loaded), and when.
    """

    store: Store | None
    seconds: float
    saved: Run | None = None
    time: float = -math.inf

    def save(self, run: Run, last: bool = False) -> Run:
        """The same run, saved if it is time."""
        if self.store is not None and run is not self.saved and (last or monotonic() - self.time >= self.seconds):
            self.store.save(run)
            self.saved, self.time = run, monotonic()
        return run


def origin(**facts: object) -> str:
    """The facts that a chain depends on, as canonical JSON."""
    return json.dumps(facts, sort_keys=True, default=str)


def _write_ensemble(group: h5py.Group, ensemble: Ensemble) -> None:
    """The layout of emcee 3's HDFBackend."""
    import emcee  # late: it imports scipy.stats, which takes half a second

    group.attrs["version"] = emcee.__version__
    group.attrs["nwalkers"], group.attrs["ndim"] = ensemble.positions.shape
    group.attrs["has_blobs"] = False
    group.attrs["iteration"] = len(ensemble.chain)
    for number, part in enumerate(ensemble.random_state):
        group.attrs[f"random_state_{number}"] = part
    group["accepted"] = ensemble.accepted
    group["chain"] = ensemble.chain
    group["log_prob"] = ensemble.chain_log_prob
    group["positions"] = ensemble.positions
    group["positions_log_prob"] = ensemble.log_prob


def _read(group: h5py.Group) -> Run:
    names = sorted((name for name in group if name.startswith("ensemble")), key=lambda name: int(name[8:]))
    attributes = group.attrs
    return Run(
        ensembles=tuple(_read_ensemble(group[name]) for name in names),
        proposal=StudentTMixture(
            weights=group["proposal/weights"][...],
            means=group["proposal/means"][...],
            scales=group["proposal/scales"][...],
            freedom=float(group["proposal/freedom"][()]),
        ),
        time=float(attributes["time"]),
        tau=np.asarray(attributes["tau"]),
        rounds=int(attributes["rounds"]),
        burned=int(attributes["burned"]),
        level=float(attributes["level"]),
        settled=bool(attributes["settled"]),
        producing=bool(attributes["producing"]),
        evaluations=int(attributes["evaluations"]),
    )


def _read_ensemble(group: h5py.Group) -> Ensemble:
    count = sum(name.startswith("random_state_") for name in group.attrs)
    return Ensemble(
        positions=group["positions"][...],
        log_prob=group["positions_log_prob"][...],
        random_state=tuple(group.attrs[f"random_state_{number}"] for number in range(count)),
        chain=group["chain"][...],
        chain_log_prob=group["log_prob"][...],
        accepted=group["accepted"][...],
    )
