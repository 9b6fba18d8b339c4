"""What a hidden effect can be taken for, at the size that comes closest."""

import numpy as np
import pytest
from causes import BY_NAME
from rig_tests import planned_tests
from rivals import closest
from specimen import CENTRE
from strength import ground

TESTS = planned_tests(np.random.default_rng(3))


@pytest.fixture(scope="module")
def place():
    return ground(CENTRE, TESTS, "white")


def hidden(place, name, size):
    """Rows of an effect of this size in its last place."""
    cause = BY_NAME[name]
    (knob,) = cause.typical
    return place.gaps([{knob: size}], {knob: cause.places[-1]})[:, 0]


def test_a_short_delay_is_a_low_pass(place):
    """The two differ by the square of their time: a direction taken at a long one says otherwise."""
    gap = hidden(place, "delay", 3e-4)
    linear, found = place.separation(gap), closest(place, gap)
    assert place.left(gap) > 50
    assert linear["sensor_lowpass"] > 10
    assert found["sensor_lowpass"] < 2
    assert found["delay"] < 1e-3
    long = closest(place, hidden(place, "delay", 8e-3))
    assert long["sensor_lowpass"] > 50


def test_a_small_play_is_one_of_distributed_width(place):
    small, large = (closest(place, hidden(place, "backlash", size)) for size in (1e-4, 1.5e-3))
    assert small["graded_play"] < 1 < 50 < large["graded_play"]
    assert small["backlash"] < 1e-3 * small["cornering_stiffness"]


def test_what_is_far_is_left_as_it_was(place):
    gap = hidden(place, "delay", 3e-4)
    linear, found = place.separation(gap), closest(place, gap)
    assert found.keys() == {*linear, "graded_play"}
    assert all(found[name] == left for name, left in linear.items() if left > 60)
