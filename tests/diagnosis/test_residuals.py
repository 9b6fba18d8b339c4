"""Residual tests and maps: they see what is planted, and nothing where there is nothing."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import NOISE, damper_fit
from scipy.stats import f as fisher
from scipy.stats import multivariate_t

from mofit.diagnosis.candidate_model import doubt_of_constants
from mofit.diagnosis.residual_map import homogeneity, residual_map
from mofit.diagnosis.residual_tests import residual_tests


def planted(per_line: float, frequency: float, test: int = 2):
    """The fitted damper with a cosine of this amplitude [N] added to one test's residual."""
    fitted = damper_fit()
    observed = fitted.hypothesis.observed
    w = observed.records[test][2]
    time = np.arange(w.count) * w.step
    rows = np.zeros(len(fitted.residual))
    rows[: len(observed.measured)][observed.record == test] = w.rows(
        np.pad(per_line * np.cos(2 * np.pi * frequency * time), (w.start, 0))[:, None]
    )[:, 0]
    return replace(fitted, residual=fitted.residual + rows)


def everywhere(fitted, signal):
    """The fitted damper with a signal, of time [s] and frequency [Hz], added to every test's residual."""
    observed = fitted.hypothesis.observed
    rows = np.zeros(len(fitted.residual))
    for place, (_, _, w) in enumerate(observed.records):
        added = signal(np.arange(w.count) * w.step, 1 / w.period)
        rows[: len(observed.measured)][observed.record == place] = w.rows(np.pad(added, (w.start, 0))[:, None])[:, 0]
    return replace(fitted, residual=fitted.residual + rows)


def test_nothing_is_left_where_nothing_is_missing() -> None:
    for seed in (1, 2):
        assert residual_tests(damper_fit(seed=seed)).p_value > 0.01
        assert not residual_map(damper_fit(seed=seed)).significant(0.01)


@pytest.mark.parametrize(("frequency", "name"), [(4.0, "even"), (6.0, "odd"), (13.7, "highest other line")])
def test_a_planted_line_is_found_in_its_class(frequency: float, name: str) -> None:
    found = residual_tests(planted(NOISE, frequency))
    assert found.p_value < 1e-6
    assert name in {one.name for one in found.tests if one.p_value < 1e-4}


def test_a_small_gap_on_many_harmonics_is_seen_in_all_together() -> None:
    """A pulse at one place of every stroke: a tenth of the noise on each harmonic."""
    found = residual_tests(
        everywhere(
            damper_fit(),
            lambda time, frequency: 0.1 * NOISE * sum(np.cos(2 * np.pi * h * frequency * time) for h in range(1, 11)),
        )
    )
    first, second, *_ = found.tests
    assert first.name == "harmonics together"
    assert first.p_value < 1e-3 * second.p_value


@pytest.mark.parametrize(
    ("signal", "name"),
    [
        (lambda time, _: 0.3 * NOISE * np.cos(2 * np.pi * 23.02 * time), "a line of 23 Hz in all tests together"),
        (
            lambda time, frequency: 0.3 * NOISE * np.cos(np.pi * frequency * time),
            "lines at 1/2 of the excitation frequency",
        ),
    ],
)
def test_what_is_too_small_for_a_single_test_is_seen_in_all_together(signal, name) -> None:
    found = residual_tests(everywhere(damper_fit(), signal))
    assert found.tests[0].description == name
    assert found.tests[0].rms == pytest.approx(0.3 * NOISE / np.sqrt(2), rel=0.35)
    assert found.p_value < 1e-3
    # no other test sees it
    assert len(found.tests) * found.tests[1].p_value > 1e-3


def test_constants_of_all_records_are_known_as_well_as_one() -> None:
    """Their noise is extrapolated from the lines above zero frequency, alike in all records."""
    fitted = everywhere(damper_fit(), lambda time, frequency: np.full(len(time), 0.4 * NOISE * np.log2(frequency)))
    observed = fitted.hypothesis.observed
    freedom = observed.degrees_of_freedom[observed.of("dc")]
    (found,) = (one for one in residual_tests(fitted).tests if one.name == "dc")
    power, count = found.statistic / found.degrees_of_freedom, found.degrees_of_freedom
    assert fisher.sf(power, count, freedom.max()) <= found.p_value <= fisher.sf(power, count, freedom.min())
    assert found.p_value > 10 * fisher.sf(power, count, freedom.sum())


@pytest.mark.parametrize("offset", [0.0, 0.1, 10.0])
def test_constants_count_by_a_multivariate_t_distribution(offset: float) -> None:
    fitted = everywhere(damper_fit(), lambda time, frequency: np.full(len(time), offset * NOISE * np.log2(frequency)))
    observed = fitted.hypothesis.observed
    constants = fitted.residual[: len(observed.measured)][observed.of("dc")]
    freedom = len(constants) / np.sum(1 / observed.degrees_of_freedom[observed.of("dc")])
    density = multivariate_t(shape=np.eye(len(constants)), df=freedom).logpdf
    surprise = 2 * (density(np.zeros(len(constants))) - density(constants))
    assert constants @ constants - doubt_of_constants(fitted) == pytest.approx(surprise)


def test_the_gap_is_measured_in_newtons() -> None:
    where = residual_map(planted(5 * NOISE, 6.0))
    (entry,) = where.significant(0.01)
    assert (entry.test, entry.lines) == ("2Hz", "odd")
    assert entry.gap == pytest.approx(5 * NOISE / np.sqrt(2), rel=0.1)
    assert entry.share > 0.9
    assert where.gap == pytest.approx(5 * NOISE / np.sqrt(2) / 2, rel=0.1)  # one of four tests
    assert np.nanmax(np.abs(where.input_map.gap)) > 2 * NOISE
    assert max(np.mean(part.gap) for part in where.time_maps) == np.mean(where.time_maps[2].gap)


def test_single_tests_agree_unless_something_is_missing() -> None:
    assert all(not one.p_value < 0.01 for one in homogeneity(damper_fit()))
    lacking = damper_fit((("second_branch", (("c_2", 2000.0),)),))
    worst = min(homogeneity(lacking), key=lambda one: np.nan_to_num(one.p_value, nan=1.0))
    assert worst.p_value < 1e-4
    assert worst.i_squared > 0.5
