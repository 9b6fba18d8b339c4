"""What tests could distinguish at best: from directions of known angles."""

from dataclasses import replace

import numpy as np
import pytest
from fixed_test_plans import Tyre, competitors
from rig_tests import sine
from strength import Ground, ruled_out_probability


def test_a_rival_leaves_the_sine_of_its_angle_beside_the_parameters():
    # the parameter lies along the first axis; beside it a and b stand at 30 degrees, c at right angles to both
    a, b, c = np.eye(4)[1], np.array([0, np.sqrt(3) / 2, 0.5, 0]), np.eye(4)[3]
    place = Ground(
        specimen={},
        tests=tuple(replace(sine(1.0), name=name) for name in ("step", "sine", "more_0", "more_1")),
        noise="white",
        clean=tuple(np.zeros((4, 1))),
        places=tuple(slice(i, i + 1) for i in range(4)),
        jacobian=np.eye(4)[:, :1],
        directions={name: (v[:, None],) for name, v in (("a", a), ("b", b), ("c", c))},
    )
    one = Tyre(place, {"a": 7 * a + 5 * np.eye(4)[0], "c": c})
    assert competitors(one, {"more_0", "more_1"}) == pytest.approx([0.25, 1.0])
    # without the test in which they differ nothing tells a from b
    assert competitors(one, {"more_1"}) == pytest.approx([0.0, 1.0], abs=1e-12)


@pytest.mark.parametrize("times", [1, 10])
@pytest.mark.parametrize("left", [1.0, 9.0, 40.0])
def test_the_chance_is_that_of_noisy_data(left, times):
    # truth and rival are close unit directions; the gap is so long that the rival leaves this much of it
    rng, angle = np.random.default_rng(1), 0.05
    gap = np.array([np.sqrt(left) / np.sin(angle), 0.0])
    data = gap + rng.normal(size=(100_000, 2))
    rival = data @ [np.cos(angle), np.sin(angle)]
    named = data[:, 0] ** 2 - rival**2 > 2 * np.log(times)
    assert ruled_out_probability(np.array([left]), times)[0] == pytest.approx(named.mean(), abs=0.005)
