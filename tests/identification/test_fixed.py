"""Fixed parameters: with their own unit in the result, and never at the cost of the baseline."""

import numpy as np
import pytest
from labels import unlabelled

from mofit.data import Campaign, Experiment, Measurement
from mofit.errors import InputError
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.sampling import SampleSettings

TRUTH = {"c": 1e3, "p": 0.0, "d": 50.0, "F_0": 0.0, "c_M": 2e4, "d_M": 800.0}


@pytest.fixture(scope="module")
def campaign():
    """Sines of a Maxwell damper in steady state, with noise."""
    rng, tests = np.random.default_rng(1), []
    for frequency in (1.0, 4.0):
        w, time = 2 * np.pi * frequency, np.arange(0, 5 / frequency, 0.01 / frequency)
        branch = 1 / (1 / TRUTH["c_M"] + 1 / (1j * w * TRUTH["d_M"]))
        stiffness = TRUTH["c"] + 1j * w * TRUTH["d"] + branch
        force = 0.01 * np.imag(stiffness * np.exp(1j * w * time)) + rng.normal(size=len(time))
        stroke = 0.01 * np.sin(w * time)
        experiment = Experiment(f"sine_{frequency:g}Hz", "sine", time, {"displacement": stroke}, {}, frequency, 0.01)
        tests.append(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
    return Campaign("damper", "simulated", {}, tuple(tests))


@pytest.mark.slow
def test_a_baseline_with_every_parameter_fixed_is_identified_freely(campaign, tmp_path):
    fixed = {name: TRUTH[name] for name in ("c", "p", "d", "F_0")}
    few = SampleSettings(max_steps=40, min_rounds=1, max_rounds=1)  # the posterior is not asked for
    settings = Settings(fixed=fixed, jobs=1, sampling=few)
    _, tree = identify(campaign, find_model("maxwell_damper"), settings, out=tmp_path / "run")
    assert list(tree["parameters"]["parameter"].values) == ["c_M", "d_M"]
    assert {name: v.attrs["units"] for name, v in tree["fixed"].data_vars.items()} == {
        "c": "N/m", "p": "N/m^2", "d": "N s/m", "F_0": "N",
    }  # fmt: skip
    assert unlabelled(tree) == []
    assert np.isfinite(tree["baseline"]["nrmsd"]).all()
    # it has found a damper of its own
    assert float(tree["baseline"]["value"].sel(parameter_baseline="d")) > 2 * TRUTH["d"]


def test_fixing_all_that_is_searched_is_refused(tmp_path):
    from mofit.data import bundled_campaign, read_campaign

    model = find_model("kelvin_voigt_tyre")
    with pytest.raises(InputError, match="--fix: fixes every parameter"):
        identify(read_campaign(bundled_campaign()), model, Settings(fixed={"d_y": 281.0}), out=tmp_path / "run")
    assert list(tmp_path.iterdir()) == []
