"""Whitened rows, the classes of their lines, and interference: sinusoids of one frequency in all tests."""

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.data.signals import SignalAnalysis
from mofit.diagnosis.spectral_classes import (
    CLASS_INDEX,
    SPECTRAL_CLASSES,
    classify,
    interference_lines,
    rotational_orders,
)
from mofit.diagnosis.whitening import Whitening, whitening

STEP, PERIOD = 0.01, 0.5
COUNT = 2000


def record(period: float | None = PERIOD) -> SignalAnalysis:
    return SignalAnalysis(period, 0, 0.0, 0.0, {}, "", {})


def noise_of(kind: str, rng: np.random.Generator) -> np.ndarray:
    white = rng.standard_normal(COUNT)
    if kind == "white":
        return 3.0 * white
    return lfilter([1.0], [1.0, -0.8], white)


def signal() -> np.ndarray:
    return 100.0 * np.sin(2 * np.pi * np.arange(COUNT) * STEP / PERIOD)


def white_of(values: np.ndarray, period: float | None = PERIOD, sd: float = 3.0):
    return whitening(values, np.ones(COUNT, dtype=bool), STEP, record(period), sd)


@pytest.mark.parametrize("kind", ["white", "coloured"])
def test_rows_of_noise_have_unit_variance(kind: str, rng: np.random.Generator) -> None:
    noise = noise_of(kind, rng)
    w = white_of(signal() + noise)
    rows = w.rows(noise[:, None])[:, 0]
    assert len(rows) == w.count
    low = rows[w.frequencies[w.line_of_row] < 10]
    for part in (rows, low):
        assert np.mean(part**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(part)))


def test_a_hum_is_no_noise(rng: np.random.Generator) -> None:
    noise = noise_of("white", rng)
    hum = 3.0 * np.sin(2 * np.pi * 7.3 * np.arange(COUNT) * STEP)
    without, with_hum = white_of(signal() + noise), white_of(signal() + noise + hum)
    assert np.median(with_hum.process.spectrum) == pytest.approx(np.median(without.process.spectrum), rel=0.06)


def test_rows_are_those_of_least_squares_and_can_be_turned_back(rng: np.random.Generator) -> None:
    w = white_of(signal() + noise_of("white", rng), None, sd=2.0)
    values = rng.standard_normal((COUNT, 1))
    rows = w.rows(values)
    assert np.sum(rows**2) == pytest.approx(np.sum(values**2) / 2.0**2)
    np.testing.assert_allclose(w.signal(rows[:, 0]), values[:, 0], atol=1e-9)


def test_batches_are_the_rows_one_by_one(rng: np.random.Generator) -> None:
    w = white_of(signal() + noise_of("coloured", rng))
    values = rng.standard_normal((3, COUNT, 2))
    rows = w.rows(values)
    np.testing.assert_allclose(rows[2, :, 1], w.rows(values[2, :, 1:])[:, 0], atol=1e-12)


def test_lines_know_their_class(rng: np.random.Generator) -> None:
    w = white_of(signal() + noise_of("white", rng))
    kinds = classify(w, signal(), {"wheel": 8.7})
    named = {
        f: SPECTRAL_CLASSES[kinds[np.argmin(np.abs(w.frequencies - f))]].name
        for f in (0, 0.5, 1, 2, 3, 4, 6, 8.7, 6.7, 7.3, 22)
    }
    assert named == {
        0: "dc", 0.5: "slow", 1: "subharmonic", 2: "odd", 3: "subharmonic", 4: "even", 6: "odd", 8.7: "rotating",
        6.7: "rotating", 7.3: "other", 22: "other",
    }  # fmt: skip


def test_a_chirp_excites_its_band(rng: np.random.Generator) -> None:
    time = np.arange(COUNT) * STEP
    chirp = np.sin(2 * np.pi * (0.5 * time + 0.1 * time**2))  # 0.5 to 4.5 Hz
    w = white_of(chirp + noise_of("white", rng), None)
    kinds = classify(w, chirp, {})
    excited = w.frequencies[kinds == CLASS_INDEX["excited"]]
    assert excited.min() < 0.1
    assert 6 < excited.max() < 14


def test_orders_at_sixty_kilometres_per_hour() -> None:
    from mofit.data import bundled_campaign, read_campaign

    found = rotational_orders(read_campaign(bundled_campaign()).measurements[-1])
    assert found["wheel"] == pytest.approx(8.70, abs=0.01)
    assert found["drum"] == pytest.approx(4.35, abs=0.01)


#: some periods are no whole number of samples: the excitation leaks onto other lines
SINES = (0.5, 1.0, 2.0, 3.0, 3.5)


def sines_with(
    hum: float, rng: np.random.Generator, colour: float = 0.0, at: float = 7.3
) -> tuple[list[Whitening], list[np.ndarray], list[np.ndarray]]:
    """Five sines of 1000 in noise of 20, and a sinusoid common to all."""
    records, rows, free = [], [], []
    for frequency in SINES:
        time = STEP * np.arange(round(max(8 / frequency, 8) / STEP))
        noise = 20 * np.sqrt(1 - colour**2) * lfilter([1.0], [1.0, -colour], rng.standard_normal(len(time)))
        values = 1000 * np.sin(2 * np.pi * frequency * time) + noise
        values += hum * np.sin(2 * np.pi * at * time + rng.uniform(0, 6))
        w = whitening(values, np.ones(len(time), dtype=bool), STEP, record(1 / frequency), 20)
        records.append(w)
        rows.append(w.noise_rows(values))
        free.append(~w.harmonic)
    return records, rows, free


def test_a_hum_too_weak_for_one_test_is_found_in_five(rng: np.random.Generator) -> None:
    records, rows, free = sines_with(4.0, rng)
    found = interference_lines(records, rows, free)
    for w, lines in zip(records, found, strict=True):
        assert np.abs(w.frequencies[lines] - 7.3).max() < 2 / (w.count * w.step)
        assert lines.sum() >= 2
    alone = [interference_lines([w], [r], [f])[0].any() for w, r, f in zip(records, rows, free, strict=True)]
    assert not any(alone)


def test_a_hum_on_a_harmonic_of_most_tests_is_found_in_the_others(rng: np.random.Generator) -> None:
    """7 Hz is a harmonic of three of the five: what they hold there may be anything."""
    found = interference_lines(*sines_with(5.0, rng, at=7.0))
    assert all(lines.any() for f, lines in zip(SINES, found, strict=True) if f in (2.0, 3.0))


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_noise_has_no_interference(colour: float, rng: np.random.Generator) -> None:
    for _ in range(2):
        assert not any(lines.any() for lines in interference_lines(*sines_with(0.0, rng, colour)))
