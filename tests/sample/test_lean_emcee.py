"""Importing the sampler leaves scipy.stats alone, and emcee whole."""

import subprocess
import sys

LEAN = "import sys, mofit.sample; assert 'scipy.stats' not in sys.modules"
WHOLE = """
import emcee, numpy as np, scipy
walkers = np.random.default_rng(0).random((40, 2))
emcee.moves.KDEMove().get_proposal(walkers[:20], [walkers[20:]], np.random.RandomState(0))
assert scipy.stats.norm.cdf(0.0) == 0.5
"""


def test_emcee_is_imported_without_scipy_stats_and_works():
    subprocess.run([sys.executable, "-c", LEAN + WHOLE], check=True)
