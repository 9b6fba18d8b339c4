"""What a comparison of procedures holds: every number that the terminal, the page and ``--json`` show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.confirm import Limits
from mofit.identifiability.telling import Told

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Procedure:
    """Tests that would be identified together: a name, the place of their source, and their names."""

    name: str
    source: int
    tests: tuple[str, ...]


@dataclass(frozen=True)
class Entry:
    """One parameter in one procedure; SI units, standard deviations at most those of the bounds.

    Parameters
    ----------
    parameter
        Its name.
    verdict
        One of `mofit.identifiability.verdicts.VERDICTS`.
    sd, relative_sd
        Expected standard deviation of the estimate, median over the parameter sets; and over the value's magnitude.
    sd_here
        The same at the stated values alone; from the profile, where one was traced and closes.
    low, high
        Least and largest ``relative_sd`` over the parameter sets.
    bound_sd
        Of the best estimate that the tests allow (Fisher information), at the stated values.
    conditional_sd
        All other parameters known, at the stated values.
    inflation
        Variance inflation factor there.
    per_minute
        ``relative_sd`` after 60 s of this procedure, at the stated values.
    verdicts
        How many of the parameter sets have which verdict, before profiles.
    partners
        Parameters that make up for it, in a combination.
    limits
        Of the profile, where one was traced.
    sentence
        All of this in words.
    """

    parameter: str
    verdict: str
    sd: float
    relative_sd: float
    sd_here: float
    low: float
    high: float
    bound_sd: float
    conditional_sd: float
    inflation: float
    per_minute: float
    verdicts: Mapping[str, int]
    partners: tuple[str, ...]
    limits: Limits | None
    sentence: str

    @property
    def varies(self) -> bool:
        """Whether the verdict depends on where in the parameter space it is asked."""
        return len(self.verdicts) > 1


@dataclass(frozen=True, eq=False)
class Judged:
    """One procedure: its parameters, and how they hang together at the stated values.

    Parameters
    ----------
    procedure
        Its tests.
    seconds
        Their duration, without calibration tests and pauses.
    entries
        By parameter.
    covariance
        Of all parameters in the unit cube with their bounds, (d, d).
    condition
        Largest condition index of the parameters that no calibration stage knows, those being nuisances.
    """

    procedure: Procedure
    seconds: float
    entries: Mapping[str, Entry]
    covariance: Array
    condition: float


@dataclass(frozen=True)
class Carried:
    """Which tests carry what a procedure knows of its parameters; T tests, P parameters.

    Parameters
    ----------
    procedure
        Name of the procedure.
    tests
        Names.
    share
        Of the precision of each parameter, all others estimated along, (T, P).
    calibration
        Share of the calibration stages, (P,); what is missing to 1 is from the bounds.
    without
        Standard deviation without the test over that with all, (T, P).
    """

    procedure: str
    tests: tuple[str, ...]
    share: Array
    calibration: Array
    without: Array


@dataclass(frozen=True, eq=False)
class Comparison:
    """Procedures side by side.

    Parameters
    ----------
    parameters
        Those that are shown.
    asked
        Those that were asked for by name.
    told
        What the tests of each source tell.
    judged
        The procedures.
    carried
        Of every procedure of several tests.
    notes
        What a reader should know, in sentences.
    """

    parameters: tuple[str, ...]
    asked: tuple[str, ...]
    told: tuple[Told, ...]
    judged: tuple[Judged, ...]
    carried: tuple[Carried, ...]
    notes: tuple[str, ...]

    @property
    def lost(self) -> tuple[str, ...]:
        """Parameters asked for that no procedure identifies."""
        return tuple(
            name for name in self.asked if not any(row.entries[name].verdict == "identifiable" for row in self.judged)
        )
