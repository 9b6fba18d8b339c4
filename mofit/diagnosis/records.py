"""Every record as the page shows it: measured and simulated over a period, and the spectrum of what is left."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import fft

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.diagnosis.whitening import Whitening
from mofit.simulation import exciting_channel

#: Samples that are kept of a record without period, and lines of a spectrum: the lowest.
_MOST_SAMPLES, _MOST_LINES = 1500, 800


def page_records(observed: WhitenedData, baseline: Fitted, best: Fitted) -> Iterator[dict[str, Any]]:
    """What excites every record, measured and simulated output: its last period, or the end of it; its spectrum.

    Parameters
    ----------
    observed
        The data.
    baseline, best
        Model without effects, and best model, fitted.
    """
    before, after = (one.hypothesis.outputs(one.minimum.point[None]) for one in (baseline, best))
    for index, (test, output, w) in enumerate(observed.records):
        measurement, channel = observed.problem.measurements[test], observed.problem.model.outputs[output]
        name = exciting_channel(observed.problem.model, measurement)
        length = round(w.period / w.step) + 1 if w.periods else _MOST_SAMPLES
        stop = w.start + w.count
        cut = slice(max(stop - length, w.start), stop)
        measured = measurement.channel(channel.name)
        simulated = {"before": before[test][0][0, :, output], "after": after[test][0][0, :, output]}
        yield {
            "test": measurement.name,
            "kind": measurement.kind,
            "frequency": 1 / w.period if w.periods else None,
            "input_name": name.replace("_", " "),
            "input_unit": measurement.units[name],
            "output_name": channel.name.replace("_", " "),
            "output_unit": channel.unit,
            "time": measurement.time[cut],
            "input": measurement.channel(name)[cut],
            "measured": measured[cut],
            **{key: values[cut] for key, values in simulated.items()},
            "spectrum": {
                "frequency": w.frequencies[1 : _MOST_LINES + 1],
                "lines": _classes(observed, index, w)[1 : _MOST_LINES + 1],
                "noise": _noise(w)[1 : _MOST_LINES + 1],
                **{key: _amplitude(measured - values, w)[1 : _MOST_LINES + 1] for key, values in simulated.items()},
            },
        }


def _classes(observed: WhitenedData, record: int, w: Whitening) -> list[str]:
    """Name of the spectral class of every line."""
    found = np.zeros(len(w.frequencies), dtype=np.int64)
    found[w.line_of_row] = observed.spectral_class[observed.record == record]
    return [SPECTRAL_CLASSES[k].name for k in found]


def _amplitude(residual: FloatArray, w: Whitening) -> FloatArray:
    used = residual[w.start : w.start + w.count]
    return np.asarray(2 / w.count * np.abs(fft.rfft(used)))


def _noise(w: Whitening) -> FloatArray:
    r"""Expected amplitude of noise of spectrum S and level g: :math:`\sqrt{\pi S_k \overline{g^2} / n}` (Rayleigh)."""
    return np.asarray(np.sqrt(np.pi * w.process.spectrum * np.mean(w.process.level**2) / w.count))
