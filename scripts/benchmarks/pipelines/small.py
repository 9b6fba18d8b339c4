"""A job small enough for all to run: one sine test, cut short, and two parameters."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.pipelines.job import MODEL, Job, make_job, pose
from mofit.data import Campaign, Measurement, bundled_campaign, read_campaign
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import find_model

TEST, SECONDS = "sine_4_00Hz", 0.5
FREE = ("d_y", "c_M")


def campaign() -> Campaign:
    """The test from rest, its first seconds."""
    whole = read_campaign(bundled_campaign())
    return replace(whole, measurements=(_first_seconds(whole[TEST]),))


def _first_seconds(measurement: Measurement) -> Measurement:
    experiment = measurement.experiment
    kept = slice(0, int((experiment.time < experiment.time[0] + SECONDS).sum()))
    inputs = {name: values[kept] for name, values in experiment.inputs.items()}
    outputs = {name: values[kept] for name, values in measurement.outputs.items()}
    return replace(
        measurement, experiment=replace(experiment, time=experiment.time[kept], inputs=inputs), outputs=outputs
    )


def settings(seed: int) -> Settings:
    """One core; the parameters of the steady state are the model's nominal ones."""
    fixed = {p.name: p.nominal for p in find_model(MODEL).parameters if p.name not in FREE}
    return Settings(seed=seed, jobs=1, fixed=fixed)


def job(seed: int) -> Job:
    """What the peers get."""
    return make_job(*pose(settings(seed), campaign()))


def identify(seed: int) -> tuple[int, float, int]:
    """mofit from the campaign to the sampled modes: how many, least effective draws, evaluations of the sampler."""
    modes = find_modes(campaign(), find_model(MODEL), settings(seed))
    chains = [mode.chains for mode in modes]
    return len(modes), min(c.effective_draws for c in chains), sum(c.evaluations for c in chains)
