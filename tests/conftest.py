"""What all tests share."""

import os
from pathlib import Path

# the workers of one run share the machine: no thread pools inside numpy; figures without a display
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

# the same examples on every machine and no limit on time, which shared machines cannot keep
settings.register_profile(
    "mofit", derandomize=True, deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("mofit")

SHARED = Path(__file__).resolve().parents[1] / ".." / "shared" / "data"


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20160701)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of measured data beside the repository, read in place; skips where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("no measured data: ../shared/data is absent")
    return SHARED
