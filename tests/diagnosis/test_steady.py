"""Lines of one frequency in all tests: found where they are, and only there."""

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.diagnosis.steady import steady_lines
from mofit.diagnosis.whitening import Whitening, whitening
from mofit.signals import Record

STEP = 0.01
#: some periods are no whole number of samples: the excitation leaks onto other lines
FREQUENCIES = (0.5, 1.0, 2.0, 3.0, 3.5)


def sines_with(
    hum: float, rng: np.random.Generator, colour: float = 0.0, at: float = 7.3
) -> tuple[list[Whitening], list[np.ndarray], list[np.ndarray]]:
    """Five sines of 1000 in noise of 20, and a steady line."""
    records, rows, free = [], [], []
    for frequency in FREQUENCIES:
        time = STEP * np.arange(round(max(8 / frequency, 8) / STEP))
        noise = 20 * np.sqrt(1 - colour**2) * lfilter([1.0], [1.0, -colour], rng.standard_normal(len(time)))
        values = 1000 * np.sin(2 * np.pi * frequency * time) + noise
        values += hum * np.sin(2 * np.pi * at * time + rng.uniform(0, 6))
        w = whitening(values, np.ones(len(time), dtype=bool), STEP, Record(1 / frequency, 0, 0.0, 0.0, {}, "", {}), 20)
        records.append(w)
        rows.append(w.noise_rows(values[:, None])[:, 0])
        free.append(~w.harmonic)
    return records, rows, free


def test_a_hum_too_weak_for_one_test_is_found_in_five(rng: np.random.Generator) -> None:
    records, rows, free = sines_with(4.0, rng)
    found = steady_lines(records, rows, free)
    for w, lines in zip(records, found, strict=True):
        assert np.abs(w.frequencies[lines] - 7.3).max() < 2 / (w.count * w.step)
        assert lines.sum() >= 2
    alone = [steady_lines([w], [r], [f])[0].any() for w, r, f in zip(records, rows, free, strict=True)]
    assert not any(alone)


def test_a_hum_on_a_harmonic_of_most_tests_is_found_in_the_others(rng: np.random.Generator) -> None:
    """7 Hz is a harmonic of three of the five: what they hold there may be anything."""
    found = steady_lines(*sines_with(5.0, rng, at=7.0))
    assert all(lines.any() for f, lines in zip(FREQUENCIES, found, strict=True) if f in (2.0, 3.0))


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_noise_has_no_steady_line(colour: float, rng: np.random.Generator) -> None:
    for _ in range(4):
        assert not any(lines.any() for lines in steady_lines(*sines_with(0.0, rng, colour)))
