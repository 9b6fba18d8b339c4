"""The problem set up: which tests, which parameters are free, the results of the calibration stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from mofit.data import Campaign
from mofit.errors import InputError, Issue, raise_errors
from mofit.identification.calibration import Calibration, calibrate, calibrated_by, calibrated_values
from mofit.identification.settings import Settings, free_space
from mofit.models import Model
from mofit.parameters import ParameterSpace
from mofit.problem import FLAT, CampaignPosterior, JointProblem, Problem, build_problem, join_priors
from mofit.problem.pooling import hyperparameters
from mofit.simulation import ExperimentData, measured_outputs
from mofit.simulation.ranges import data_scales, scaled
from mofit.simulation.scopes import scoped


@dataclass(frozen=True)
class ProblemSetup:
    """A model and the tests of its main identification, with the stages before it fitted."""

    model: Model
    settings: Settings
    campaign: Campaign
    """The tests of the main identification only."""
    space: ParameterSpace
    """Free parameters of the campaign."""
    scoped: ParameterSpace
    """Free parameters with a value per test or condition, in ranges as the model has them."""
    calibrations: tuple[Calibration, ...]
    warnings: tuple[str, ...]
    """A sentence per stage that had no tests, and per output that no test has."""
    leads: Mapping[str, float] = field(default_factory=dict)
    """Time that the periodic inputs of tests act on the model before the first sample, s."""
    known: tuple[ExperimentData, ...] = ()
    """Tests of another problem on the campaign, for `mofit.problem.build_problem`."""
    start: Mapping[str, float] | None = None
    """Values by name to start from in place of a search."""

    @cached_property
    def searched(self) -> Problem:
        """What the search sees: calibrated parameters fixed at their estimates (free with ``joint``)."""
        known = {} if self.settings.joint else calibrated_values(self.calibrations)
        free = [name for name in self.space.names if name not in known]
        populations = hyperparameters(self.scoped)
        if not free and not (populations and self.start):
            message = "fixes every parameter of the search; the calibration stages estimate the others"
            raise InputError.of("--fix", message, "Leave one more free, or add --joint")
        means = {one.name: (self.start or {}).get(one.name, one.nominal) for one in populations}
        fixed = {**known, **self.settings.fixed, **means}
        # where all that is free is drawn from populations, these are what there is to look for
        searched = self.space.subset(free).parameters or populations
        space = ParameterSpace((*searched, *self.fitted.parameters))
        model, campaign, jobs = self.model, self.campaign, self.settings.jobs
        return build_problem(model, campaign, space=space, fixed=fixed, leads=self.leads, known=self.known, jobs=jobs)

    @property
    def fitted(self) -> ParameterSpace:
        """Scoped parameters, in wide ranges, which cost nothing as they are not searched; bounds asked for stay."""
        bounds = self.settings.bounds
        return ParameterSpace(tuple(one if one.name in bounds else one.wider() for one in self.scoped.parameters))

    @cached_property
    def posterior(self) -> CampaignPosterior:
        """What is refined and sampled: every parameter free, calibrations as priors (with ``joint``, as data)."""
        joint, prior = self.settings.joint, FLAT
        if self.calibrations and not joint:
            prior = join_priors([calibration.prior(self.space) for calibration in self.calibrations])
        space = ParameterSpace((*self.space.parameters, *hyperparameters(self.scoped)))
        main = self.searched.with_free(space, self.settings.fixed, prior)
        if joint and self.calibrations:
            return JointProblem(main, tuple(calibration.problem for calibration in self.calibrations))
        return main


def set_up_problem(
    model: Model,
    campaign: Campaign,
    settings: Settings,
    tests: Sequence[str] = (),
    *,
    space: ParameterSpace | None = None,
    done: Sequence[Calibration] = (),
    leads: Mapping[str, float] = MappingProxyType({}),
    start: Mapping[str, float] | None = None,
) -> ProblemSetup:
    """Choose tests and free parameters, and fit the calibration stages.

    Parameters
    ----------
    model, campaign, settings
        What is identified, from what, and how; the stages take their tests from the whole campaign.
    tests
        Names of the tests of the main identification; by default all whose excitation the model is made for.
    space
        Free parameters of the campaign; by default the model's, in ranges for the data (`mofit.simulation.ranges`) or
        those asked for.
    done
        Stages fitted to this campaign before; those that are the same are not fitted again.
    leads
        Time that the periodic inputs of tests act on the model before the first sample, s.
    start
        Values by name to start from: in place of a search, and beside the starts of the stages.

    Raises
    ------
    InputError
        If campaign, model and settings don't fit together.
    """
    selected = campaign.select(choose_tests(model, campaign, tests))
    model = scaled(model, data_scales(model, selected))
    shared, own = scoped(free_space(model, settings))
    space = space or shared
    _refuse_calibrated(model, campaign, own)
    calibrations, warnings = calibrate(
        model, campaign, space, seed=settings.seed, jobs=settings.jobs, done=done, start=start or {}
    )
    warnings = [*warnings, *_unmeasured(model, selected)]
    return ProblemSetup(
        model, settings, selected, space, own, tuple(calibrations), tuple(warnings), dict(leads), start=start
    )


def _refuse_calibrated(model: Model, campaign: Campaign, own: ParameterSpace) -> None:
    """Scoped parameters that a stage calibrates have no value of their own in the stage's tests."""
    raise_errors(
        Issue(f"--per-test {name}", f"stage '{stage.name}' calibrates it for all tests", "Leave it to the campaign")
        for name, stage in sorted(calibrated_by(model, campaign).items())
        if name in own.names
    )


def _unmeasured(model: Model, campaign: Campaign) -> list[str]:
    """A sentence per output of the model that no test has."""
    seen = {name for measurement in campaign.measurements for name in measured_outputs(model, measurement)}
    return [
        f"No test has the channel {channel.name}: this output of the model is compared with nothing."
        for channel in model.outputs
        if channel.name not in seen
    ]


def choose_tests(model: Model, campaign: Campaign, tests: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the tests of the main identification: those asked for, else all that suit the model.

    Raises
    ------
    InputError
        With every name that is not a test, or if no test suits the model.
    """
    if tests:
        return campaign.select(tests).tests
    chosen = tuple(m.name for m in campaign.measurements if not model.excitations or m.kind in model.excitations)
    if not chosen:
        kinds = ", ".join(sorted({m.kind for m in campaign.measurements}))
        raise InputError.of(
            f"campaign '{campaign.title}'",
            f"model '{model.name}' takes {', '.join(model.excitations)} tests; the campaign has {kinds}",
            "Choose another model or campaign",
        )
    return chosen
