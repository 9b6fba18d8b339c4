"""Tests for what is left: they see what is planted, and nothing where there is nothing."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import NOISE, damper_fit

from mofit.diagnosis.agreement import agreements
from mofit.diagnosis.locate import locate, significant
from mofit.diagnosis.remaining import remaining


def planted(per_line: float, frequency: float, test: int = 2):
    """The fitted damper with a cosine of this amplitude [N] added to one test's residual."""
    fitted = damper_fit()
    observed = fitted.hypothesis.observed
    w = observed.parts[test][2]
    time = np.arange(w.count) * w.step
    rows = np.zeros(len(fitted.residual))
    rows[: len(observed.measured)][observed.part == test] = w.rows(
        np.pad(per_line * np.cos(2 * np.pi * frequency * time), (w.start, 0))[:, None]
    )[:, 0]
    return replace(fitted, residual=fitted.residual + rows)


def everywhere(fitted, signal):
    """The fitted damper with a signal, of time [s] and frequency [Hz], added to every test's residual."""
    observed = fitted.hypothesis.observed
    rows = np.zeros(len(fitted.residual))
    for place, (_, _, w) in enumerate(observed.parts):
        added = signal(np.arange(w.count) * w.step, 1 / w.period)
        rows[: len(observed.measured)][observed.part == place] = w.rows(np.pad(added, (w.start, 0))[:, None])[:, 0]
    return replace(fitted, residual=fitted.residual + rows)


def test_nothing_is_left_where_nothing_is_missing() -> None:
    for seed in (1, 2, 3):
        assert remaining(damper_fit(seed=seed)).p > 0.01
        assert not significant(locate(damper_fit(seed=seed)), 0.01).any()


@pytest.mark.parametrize(("frequency", "clue"), [(4.0, "even"), (6.0, "odd"), (13.7, "highest other line")])
def test_a_planted_line_is_found_in_its_class(frequency: float, clue: str) -> None:
    found = remaining(planted(NOISE, frequency))
    assert found.p < 1e-6
    assert clue in {one.name for one in found.clues if one.p < 1e-4}


def test_a_gap_spread_thinly_over_many_harmonics_is_seen_in_all_together() -> None:
    """A pulse at one place of every stroke: a tenth of the noise on each harmonic."""
    found = remaining(
        everywhere(
            damper_fit(),
            lambda time, frequency: 0.1 * NOISE * sum(np.cos(2 * np.pi * h * frequency * time) for h in range(1, 11)),
        )
    )
    first, second, *_ = found.clues
    assert first.name == "harmonics together"
    assert first.p < 1e-3 * second.p


@pytest.mark.parametrize(
    ("signal", "clue"),
    [
        (lambda time, _: 0.3 * NOISE * np.cos(2 * np.pi * 23.02 * time), "a line of 23 Hz in all tests together"),
        (
            lambda time, frequency: 0.3 * NOISE * np.cos(np.pi * frequency * time),
            "lines at 1/2 of the frequency of excitation",
        ),
    ],
)
def test_what_is_too_faint_for_a_single_test_is_seen_in_all_together(signal, clue) -> None:
    found = remaining(everywhere(damper_fit(), signal))
    assert found.clues[0].told == clue
    assert found.clues[0].rms == pytest.approx(0.3 * NOISE / np.sqrt(2), rel=0.35)
    assert found.p < 1e-3
    # nothing else tells it
    assert len(found.clues) * found.clues[1].p > 1e-3


def test_the_gap_is_measured_in_newtons() -> None:
    where = locate(planted(5 * NOISE, 6.0))
    (spot,) = [spot for spot, loud in zip(where.spots, significant(where, 0.01), strict=True) if loud]
    assert (spot.test, spot.lines) == ("2Hz", "odd")
    assert spot.gap == pytest.approx(5 * NOISE / np.sqrt(2), rel=0.1)
    assert spot.share > 0.9
    assert where.gap == pytest.approx(5 * NOISE / np.sqrt(2) / 2, rel=0.1)  # one of four tests
    assert np.nanmax(np.abs(where.input_map.gap)) > 2 * NOISE
    assert max(np.mean(part.gap) for part in where.time_maps) == np.mean(where.time_maps[2].gap)


def test_single_tests_agree_unless_something_is_missing() -> None:
    assert all(not one.p < 0.01 for one in agreements(damper_fit()))
    lacking = damper_fit((("second_branch", (("c_2", 2000.0),)),))
    worst = min(agreements(lacking), key=lambda one: np.nan_to_num(one.p, nan=1.0))
    assert worst.p < 1e-4
    assert worst.i_squared > 0.5
