"""White rows: unit variance, generalised least squares, and back again."""

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.diagnosis.lines import CLASSES, classify, orders
from mofit.diagnosis.whitening import whitening
from mofit.signals import Record

STEP, PERIOD = 0.01, 0.5
COUNT = 2000


def record(period: float | None = PERIOD) -> Record:
    return Record(period, 0, 0.0, 0.0, {}, "", {})


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
    quiet, loud = white_of(signal() + noise), white_of(signal() + noise + hum)
    assert np.median(loud.process.spectrum) == pytest.approx(np.median(quiet.process.spectrum), rel=0.06)


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
    kinds = classify(w, {"wheel": 8.7}, signal())
    named = {
        f: CLASSES[kinds[np.argmin(np.abs(w.frequencies - f))]] for f in (0, 0.5, 1, 2, 3, 4, 6, 8.7, 6.7, 7.3, 22)
    }
    assert named == {
        0: "dc", 0.5: "slow", 1: "subharmonic", 2: "odd", 3: "subharmonic", 4: "even", 6: "odd", 8.7: "rotating",
        6.7: "rotating", 7.3: "other", 22: "other",
    }  # fmt: skip


def test_a_chirp_excites_its_band(rng: np.random.Generator) -> None:
    time = np.arange(COUNT) * STEP
    chirp = np.sin(2 * np.pi * (0.5 * time + 0.1 * time**2))  # 0.5 to 4.5 Hz
    w = white_of(chirp + noise_of("white", rng), None)
    kinds = classify(w, {}, chirp)
    excited = w.frequencies[kinds == CLASSES.index("excited")]
    assert excited.min() < 0.1
    assert 6 < excited.max() < 14


def test_orders_at_sixty_kilometres_per_hour() -> None:
    from mofit.bundled import bundled_campaign
    from mofit.campaign_file import read_campaign

    found = orders(read_campaign(bundled_campaign()).measurements[-1])
    assert found["wheel"] == pytest.approx(8.70, abs=0.01)
    assert found["drum"] == pytest.approx(4.35, abs=0.01)
