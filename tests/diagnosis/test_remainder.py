"""The interval of the share left on a new record, against known answers."""

import numpy as np
import pytest

from mofit.diagnosis.remainder import Power, evidence, left_on_new_records
from mofit.diagnosis.shrinkage import Share, in_percent

LINES, FREEDOM = 100, 200.0


def hold_out(missed, noise, random, estimation=1e-6):
    """A test with a gap of 1: its law misses a share, each of its lines has as much noise as the others."""
    error = float(np.sum((np.sqrt(missed / LINES) + np.sqrt(noise / LINES) * random.standard_normal(LINES)) ** 2))
    power = Power(error, 1.0, noise, noise**2 / LINES, FREEDOM, estimation, estimation**2)
    response = np.full((1, 1, 1), estimation)
    return evidence(power, response, np.ones(1), np.eye(1), 1.2 * np.eye(1), 0.2 * estimation)


def interval(hold_outs, tests, **how):
    return np.quantile(left_on_new_records(hold_outs, tests, np.random.default_rng(0), **how), (0.05, 0.95))


def test_of_an_exact_law_the_estimation_error_is_left_or_what_the_noise_hides() -> None:
    random = np.random.default_rng(1)
    tests = [hold_out(0.0, 1e-2, random) for _ in range(6)]
    low, high = interval(tests, tests)
    assert low < 1e-6 < high
    # the noise's power is known to 15 %
    assert high < 0.15 * 1e-2


def test_more_noise_hides_more() -> None:
    ends = []
    for noise in (1e-3, 1e-1):
        random = np.random.default_rng(1)
        tests = [hold_out(0.0, noise, random) for _ in range(6)]
        ends.append(interval(tests, tests)[1])
    assert ends[1] > 10 * ends[0]


def test_what_a_law_misses_beyond_the_noise_is_found() -> None:
    random = np.random.default_rng(1)
    tests = [hold_out(0.1, 1e-3, random) for _ in range(8)]
    low, high = interval(tests, tests)
    # tests that agree tell that records do, within the spread that is expected beforehand
    assert 0.05 < low < 0.1 < high < 0.2


@pytest.mark.parametrize(("count", "covered"), [(4, 0.8), (12, 0.8)])
def test_the_interval_holds_a_new_record_where_tests_differ(count: int, covered: float) -> None:
    """What the law misses differs by factors of about 2: some nine of ten new records lie within."""
    random, inside = np.random.default_rng(2), []
    for _ in range(60):
        missed = np.exp(np.log(0.02) + 0.7 * random.standard_normal(count + 1))
        tests = [hold_out(one, 1e-3, random) for one in missed[:-1]]
        low, high = interval(tests, tests)
        inside.append(low <= missed[-1] <= high)
    assert covered <= np.mean(inside) <= 1.0


def test_few_tests_tell_less_than_many() -> None:
    random = np.random.default_rng(3)
    tests = [hold_out(0.02, 1e-3, random) for _ in range(12)]
    few, many = (interval(some, some) for some in (tests[:2], tests))
    assert few[1] / few[0] > many[1] / many[0]


def test_tests_that_differ_by_plan_do_not_widen_what_a_record_of_one_kind_tells() -> None:
    """Its estimation error is about its own, times chi-squared: 0.004 to 3.8 of it, for the larger of two fits 1.2."""
    random = np.random.default_rng(4)
    tests = [hold_out(0.0, 1e-9, random, 10.0**k) for k in (-8, -7, -6, -5, -4)]
    record = [hold_out(0.0, 1e-9, random, 1e-6)]
    narrow, wide = (interval(record, tests, alike=one) for one in (True, False))
    assert narrow[0] > 10 * wide[0]
    assert 1e-6 < narrow[1] < 2e-5 < wide[1] / 10


def test_a_new_record_of_one_kind_is_as_probably_like_any_of_them() -> None:
    random = np.random.default_rng(5)
    tests = [hold_out(0.0, 1e-9, random, 1e-6) for _ in range(6)]
    records = [hold_out(0.0, 1e-9, random, one) for one in (1e-7, 1e-3)]
    left = left_on_new_records(records, tests, np.random.default_rng(0), alike=True)
    assert np.mean(left < 1e-5) == pytest.approx(0.5, abs=0.1)
    kinds = [Share(kind, 0.5, 0.0, 1.0, 0.5, (), evidence=tuple(records)) for kind in ("group", "records")]
    group, told = (one.foretelling(tests, 0) for one in kinds)
    assert told.high - 1 == pytest.approx(-np.quantile(left, 0.05))
    assert group.high != told.high


def test_the_share_stays_within_its_interval() -> None:
    random = np.random.default_rng(1)
    tests = tuple(hold_out(0.1, 1e-3, random) for _ in range(4))
    share = Share("test", 0.999, 0.998, 0.9995, 0.999, (), evidence=tests)
    told = share.foretelling(tests, 0)
    assert told.low < 0.9 < told.high
    assert told.high >= told.share == 0.999


@pytest.mark.parametrize(
    ("share", "told"),
    [(0.5, "50.0"), (0.998, "99.8"), (0.9995, "99.95"), (0.99996, "99.996"), (1.0, "100.0"), (-0.27, "-27.0")],
)
def test_near_all_the_decimals_tell_what_is_left(share: float, told: str) -> None:
    assert in_percent(share) == told


def test_hardly_anything_left_is_not_nothing() -> None:
    assert in_percent(1 - 1e-9) == "99.9999"
