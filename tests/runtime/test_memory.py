"""Freed memory goes back to the system."""

import sys
from pathlib import Path

import numpy as np
import pytest

from mofit.runtime.memory import give_back


def resident() -> int:
    """Pages of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.skipif(sys.platform != "linux", reason="glibc")
def test_what_was_freed_below_something_that_stays_is_given_back():
    blocks = [np.ones(2000) for _ in range(4000)]  # 64 MB, too small to be mapped one by one
    stays, full = blocks.pop(), resident()
    del blocks
    give_back()
    assert resident() < full - 10_000
    assert stays[0] == 1.0
