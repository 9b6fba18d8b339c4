"""The main job end to end, on a rig whose truth is known."""

import csv
import io
import json
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
import xarray as xr
from arviz_stats import summary as az_summary
from damper_rig import damper_campaign
from labels import unlabelled
from lag_rig import TRUTH, campaign, write_rig

from mofit.data import read_campaign
from mofit.errors import InputError
from mofit.identification.identify import Settings, identify
from mofit.identification.stages import find_modes
from mofit.models import find_model
from mofit.results import open_result
from mofit.results.export import parameters_csv
from mofit.workflows.jobs import Job, identify_file

VOLATILE = ("created", "seconds")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return write_rig(tmp_path_factory.mktemp("rig"))


@pytest.fixture(scope="module")
def run(rig):
    file, model = rig
    return run_job(file, model, {"seed": 1, "jobs": 1}, file.parent / "run")


@pytest.fixture(scope="module")
def tree(run):
    return open_result(run[0])


def run_job(file, model, settings, out, **more):
    return identify_file(Job(file, model, settings=Settings(**settings), out=out, **more))


def same_values(a: xr.DataTree, b: xr.DataTree) -> None:
    for node in (a, b):
        for name in VOLATILE:
            node.attrs.pop(name, None)
    xr.testing.assert_identical(a, b)


def test_truth_lies_within_three_standard_deviations(run):
    _, summary = run
    assert summary["converged"]
    assert len(summary["modes"]) == 1
    for name, value in TRUTH.items():
        found = summary["modes"][0]["parameters"][name]
        assert abs(found["mean"] - value) < 3 * found["sd"]
        assert found["q05"] < found["q50"] < found["q95"]
        assert found["verdict"] == "identified"


def test_residual_is_the_noise(run):
    _, summary = run
    for test, value in summary["modes"][0]["nrmsd"].items():
        assert value == pytest.approx(summary["noise_floor"][test], rel=0.15)


def test_the_result_says_what_found_the_minima_and_whether_the_search_was_complete(run, tree):
    _, summary = run
    search = summary["search"]
    assert search["method"] == "effa"
    assert search["complete"] is True
    assert 0 < search["expected_undiscovered"] < 0.01
    assert sum(search["found_by"].values()) == search["minima"] == tree["search"].sizes["archive"]
    assert summary["modes"][0]["found_by"] == "swarm"
    assert set(tree["minima"]["found_by"].values) <= {"swarm", "completion"}
    assert set(tree["search"]["minimises"].values) == {"", *tree["search"]["objective"].values}
    assert tree["search"]["generations"].shape[2] == len(TRUTH)


def test_run_folder_holds_what_it_should(run):
    folder, summary = run
    assert {"result.nc", "report.html", "report_data", "chains.h5", "run.log"} <= {
        path.name for path in folder.iterdir()
    }
    assert not [path for path in folder.parent.iterdir() if path.name.endswith(".partial")]
    json.dumps(summary, allow_nan=False)


def test_arviz_reads_every_cluster_and_agrees(tree):
    for cluster in tree["modes"].children.values():
        table = az_summary(cluster, round_to="none")
        for name in TRUTH:
            own = cluster.to_dataset(inherit=False).sel(parameter=name)
            assert table.loc[name, "mean"] == pytest.approx(own["mean"].item(), rel=1e-9)
            assert table.loc[name, "sd"] == pytest.approx(own["sd"].item(), rel=1e-6)
            assert table.loc[name, "r_hat"] == pytest.approx(own["r_hat"].item(), rel=1e-6)
            assert table.loc[name, "ess_bulk"] == pytest.approx(own["ess"].item(), rel=1e-6)


def test_everything_stored_has_a_unit_and_a_name(tree):
    assert unlabelled(tree) == []
    posterior = tree["modes/m1/posterior"]
    assert {name: (v.attrs["units"], v.attrs["long_name"]) for name, v in posterior.data_vars.items()} == {
        "k": ("N/rad", "gain"),
        "T": ("s", "time constant"),
    }
    assert tree["modes/m1"]["sd"]["unit"].sel(parameter="k") == "N/rad"


def test_posterior_is_as_wide_as_theory_says(tree):
    """White noise of known size: the standard deviation is that of the exact Fisher information."""
    rig_campaign, step = campaign(noise=0.0), 1e-6
    names = list(TRUTH)

    def outputs(values):
        old = dict(TRUTH)
        TRUTH.update(zip(names, values, strict=True))
        try:
            return np.concatenate([m.channel("lateral_force") for m in campaign(noise=0.0).measurements])
        finally:
            TRUTH.update(old)

    centre = np.array(list(TRUTH.values()))
    slopes = np.stack([(outputs(centre + d) - outputs(centre - d)) / (2 * step) for d in np.eye(2) * step], axis=1)
    judged = np.concatenate([m.time >= 1 / m.experiment.frequency for m in rig_campaign.measurements])
    expected = np.sqrt(np.diag(np.linalg.inv(slopes[judged].T @ slopes[judged] / 0.01**2)))
    sd = tree["modes/m1"]["sd"].values
    assert sd == pytest.approx(expected, rel=0.08)


def test_same_numbers_for_any_number_of_threads(rig, tree):
    file, model = rig
    folder, _ = run_job(file, model, {"seed": 1, "jobs": 2}, file.parent / "run-2")
    same_values(open_result(folder), tree.copy(deep=True))


def test_other_seed_other_draws(rig, tree):
    file, model = rig
    (mode,) = find_modes(read_campaign(file), find_model(model), Settings(seed=2, jobs=1))
    other = mode.sampled.space.from_unit(mode.chains.thinned().points)[..., 0]
    own = tree["modes/m1/posterior/k"].values
    assert not np.array_equal(other.ravel()[:100], own.ravel()[:100])
    assert other.mean() == pytest.approx(own.mean(), abs=1e-3)


def interrupted(command, out, how):
    """Run a command and end it by a signal as soon as chains are on disk; its exit code and errors."""
    chains = out.with_name(f"{out.name}.partial") / "chains.h5"
    # what runs in the background of a shell ignores the interruption, and so would its child
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heard)
    while not chains.exists():
        assert process.poll() is None, "the run ended before it could be interrupted"
        time.sleep(0.001)
    process.send_signal(how)
    _, errors = process.communicate()
    return process.returncode, errors


@pytest.mark.parametrize(
    ("how", "code", "words"),
    [
        pytest.param(signal.SIGINT, 130, "--resume", id="interrupted"),
        pytest.param(signal.SIGKILL, -9, "", id="killed", marks=pytest.mark.slow),
    ],
)
def test_a_resumed_run_gives_the_same_numbers(how, code, words, rig, tree):
    file, model = rig
    for attempt in range(5):  # on a busy machine the run may end before the signal comes
        out = file.parent / f"{how.name}-{attempt}"
        command = [
            sys.executable,
            "-m",
            "mofit",
            "identify",
            str(file),
            "--model",
            model,
            "--seed",
            "1",
            "--out",
            str(out),
        ]
        returned, errors = interrupted(command, out, how)
        if returned:
            break
    assert returned == code
    assert words in errors
    assert "Traceback" not in errors
    done = subprocess.run([*command, "--resume", "--json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["run"] == str(out)
    same_values(open_result(out), tree.copy(deep=True))
    assert not list(out.parent.glob(f"{out.name}*.partial"))


def test_one_frequency_alone(rig):
    file, model = rig
    _, summary = run_job(file, model, {"jobs": 1}, file.parent / "one", frequencies=(1.0,))
    assert list(summary["noise_floor"]) == ["sine_1Hz"]


def test_joint_weights_bounds_and_fixed(rig):
    file, model = rig
    options = {
        "jobs": 1,
        "joint": True,
        "weights": {"sine_1Hz": 3.0},
        "bounds": {"T": (0.1, 0.3)},
        "fixed": {"k": 2.0},
        "search": "effa-2016",
    }
    folder, summary = run_job(file, model, options, file.parent / "options")
    assert list(summary["modes"][0]["parameters"]) == ["T"]
    found = open_result(folder)
    assert found["parameters"]["lower"].values == pytest.approx([0.1])
    assert found["weight"].sel(test="sine_1Hz") == 3.0
    assert float(found["fixed/k"]) == 2.0
    assert found["fixed/k"].attrs == {"units": "N/rad", "long_name": "gain"}
    rows = list(csv.DictReader(io.StringIO(parameters_csv(found))))
    assert {(row["parameter"], row["unit"], row["verdict"] == "fixed") for row in rows} == {
        ("T", "s", False),
        ("k", "N/rad", True),
    }


def test_a_model_that_always_fails_is_refused(rig):
    file, _ = rig
    (file.parent / "nan.py").write_text(
        (file.parent / "lag.py")
        .read_text()
        .replace("s.k * s.slip_angle", "ca.sqrt(-1 - s.k)")
        .replace("from mofit.models", "import casadi as ca\nfrom mofit.models", 1)
    )
    with pytest.raises(InputError, match=r"test 'sine_0.5Hz': the derivative of state 'y' is NaN at"):
        run_job(file, f"{file.parent / 'nan.py'}:Lag", {}, file.parent / "nan")
    assert not list(file.parent.glob("nan*partial"))
    assert not (file.parent / "nan").exists()


def test_unknown_names_are_refused_together(rig):
    _, model = rig
    lag = find_model(model)
    with pytest.raises(InputError) as caught:
        identify(campaign(), lag, Settings(bounds={"kk": (0, 1)}, fixed={"Tau": 1.0}))
    assert len(caught.value.issues) == 2


def test_a_run_that_is_stopped_after_the_search_leaves_what_it_found(tmp_path):
    """Without standard deviations, and named so; the resumed run has them."""
    model, settings = find_model("kelvin_voigt_damper"), Settings(jobs=1, sample=False)

    def stop(stage, *about):
        if stage == "refine":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        identify(damper_campaign(), model, settings, out=tmp_path / "run", progress=stop)
    assert "--resume" in caught.value.__notes__[0]
    known = json.loads((tmp_path / "run.partial" / "estimates.json").read_text(encoding="utf-8"))
    assert known["spread"] == "not known, not refined"
    best = known["modes"][0]["parameters"]
    assert best["d"]["value"] == pytest.approx(1500, rel=0.05)
    assert best["d"]["sd"] is None
    _, tree = identify(damper_campaign(), model, settings, out=tmp_path / "run", resume=True)
    assert float(tree["modes/m1"]["value"].sel(parameter="d")) == pytest.approx(1500, rel=0.01)
