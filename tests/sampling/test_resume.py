"""Checkpoints: readable at any moment, and a continued run ends in the same numbers."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import emcee
import h5py
import numpy as np
import pytest

from mofit.errors import InputError
from mofit.sampling import SampleSettings, sample_mode

SCALE = np.array([0.05, 0.1, 0.02])


def target(x):
    return -0.5 * np.sum(((x - 0.5) / SCALE) ** 2, axis=1) - 30 * (x[:, 0] - 0.5) * (x[:, 1] - 0.5)


class Stopped(Exception):
    pass


def stopping_after(calls):
    left = [calls]

    def interrupted(x):
        left[0] -= 1
        if left[0] < 0:
            raise Stopped
        return target(x)

    return interrupted


CASE = {"centre": np.full(3, 0.5), "covariance": np.diag(SCALE**2), "seed": [3, 1]}


@pytest.mark.parametrize("calls", [10, 30, 100, 200])
def test_interrupted_and_continued_equals_uninterrupted(tmp_path, calls):
    whole = sample_mode(target, **CASE)
    path = tmp_path / "chains.h5"
    with pytest.raises(Stopped):
        sample_mode(stopping_after(calls), **CASE, backend_path=path)
    continued = sample_mode(target, **CASE, backend_path=path)
    np.testing.assert_array_equal(whole.chain, continued.chain)
    np.testing.assert_array_equal(whole.thinned().points, continued.thinned().points)
    assert whole.evaluations == continued.evaluations
    assert whole.reasons == continued.reasons
    again = sample_mode(stopping_after(0), **CASE, backend_path=path)  # finished: nothing is computed
    np.testing.assert_array_equal(whole.chain, again.chain)


def test_a_copy_of_the_file_from_any_step_is_continued_to_the_same_draws(tmp_path):
    always = SampleSettings(checkpoint_seconds=0.0)
    path, copies = tmp_path / "chains.h5", []

    def copying(done, total, note):
        copies.append(tmp_path / f"copy{len(copies)}.h5")
        copies[-1].write_bytes(path.read_bytes())

    whole = sample_mode(target, **CASE, settings=always, backend_path=path, progress=copying)
    assert _steps(copies[1]) == 0  # burn-in
    assert 0 < _steps(copies[-2]) < whole.steps
    for copy in (copies[1], copies[len(copies) // 2], copies[-2]):
        continued = sample_mode(target, **CASE, backend_path=copy)
        np.testing.assert_array_equal(whole.thinned().points, continued.thinned().points)
        np.testing.assert_array_equal(whole.tau, continued.tau)


def test_emcee_opens_every_ensemble_and_other_modes_are_kept(tmp_path):
    path = tmp_path / "chains.h5"
    few = SampleSettings(max_steps=50)
    first = sample_mode(target, **CASE, settings=few, backend_path=path, mode="m1")
    sample_mode(target, **CASE, settings=few, backend_path=path, mode="m2")
    for mode in ("m1", "m2"):
        for number in range(4):
            backend = emcee.backends.HDFBackend(str(path), name=f"{mode}/ensemble{number}", read_only=True)
            np.testing.assert_array_equal(backend.get_chain(), first.chain[number])
            np.testing.assert_array_equal(backend.get_log_prob(), first.log_prob[number])
            assert backend.shape == (24, 3)
            assert backend.random_state[0] == "MT19937"
    assert [p.name for p in tmp_path.iterdir()] == ["chains.h5"]


def test_a_file_of_another_run_is_refused(tmp_path):
    path = tmp_path / "chains.h5"
    few = SampleSettings(max_steps=50)
    sample_mode(target, **CASE, settings=few, backend_path=path)
    for change in ({"seed": 4}, {"centre": np.full(3, 0.6)}, {"settings": SampleSettings(max_steps=60)}):
        with pytest.raises(InputError, match="another seed, other settings"):
            sample_mode(target, **{**CASE, "settings": few, **change}, backend_path=path)
    path.write_bytes(b"no HDF5")
    with pytest.raises(InputError, match="cannot be read"):
        sample_mode(target, **CASE, settings=few, backend_path=path)


SCRIPT = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_resume import CASE, target
from mofit.sampling import SampleSettings, sample_mode
settings = SampleSettings(checkpoint_seconds=0.0, chunk=4, max_steps=160, tau_multiple=1e9)
sample_mode(target, **CASE, settings=settings, backend_path=sys.argv[1])
"""


def test_kill_9_at_any_moment_leaves_a_readable_file_and_the_run_goes_on(tmp_path):
    path = tmp_path / "chains.h5"
    settings = SampleSettings(chunk=4, max_steps=160, tau_multiple=1e9)
    seen, rng = [], np.random.default_rng(0)
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-c", SCRIPT, str(path), str(Path(__file__).parent)])
        before = path.stat().st_mtime_ns if path.exists() else 0
        while process.poll() is None:  # until it has written again, then a bit
            if path.exists() and path.stat().st_mtime_ns > before:
                break
            time.sleep(0.002)
        time.sleep(rng.uniform(0, 0.4))
        process.send_signal(signal.SIGKILL)
        process.wait()
        seen.append(_steps(path))  # readable
    assert seen == sorted(seen)  # what was reached is never lost
    whole = sample_mode(target, **CASE, settings=settings)
    continued = sample_mode(target, **CASE, settings=settings, backend_path=path)
    np.testing.assert_array_equal(whole.chain, continued.chain)


def _steps(path):
    with h5py.File(path, "r") as file:
        group = file["m1"]
        assert json.loads(group.attrs["origin"])["seed"] == CASE["seed"]
        lengths = {len(group[f"ensemble{number}/chain"]) for number in range(4)}
        assert len(lengths) == 1
        return lengths.pop() if group.attrs["producing"] else 0
