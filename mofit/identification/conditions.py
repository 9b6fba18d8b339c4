"""Several conditions: every combination identified alone, and the laws that the parameters follow over them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.data.join import SPECIMEN, varying_conditions
from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.identification.calibration import calibrated_by
from mofit.identification.cells import Cell, identify_cells
from mofit.identification.joint_combinations import identified_together, shared_names
from mofit.identification.law_choice import Candidates, alternatives, choose_laws, of_informed
from mofit.identification.law_fit import CellEstimates
from mofit.identification.law_study import LawStudy
from mofit.identification.population import (
    FEWEST,
    POOLED,
    choose_populations,
    outliers,
    populations,
)
from mofit.identification.problem_setup import choose_tests
from mofit.identification.settings import Settings, free_space
from mofit.models import CONSTANT, FORMS, FREE, SHARED, Law, Model, law_issues
from mofit.parameters import Parameter
from mofit.quantities import known_unit
from mofit.runtime.progress import Progress, silent
from mofit.simulation.ranges import data_scales, scaled
from mofit.simulation.scopes import scoped

#: laws that the evidence chooses from where none is said
CHOICES = (CONSTANT, "linear", "quadratic", FREE)
#: name that stands for every parameter whose law is not said
EVERY = "others"
_CALIBRATED = "calibrated by stage '{}' from all combinations together"


def study_conditions(
    campaign: Campaign,
    model: Model,
    settings: Settings,
    tests: Sequence[str] = (),
    *,
    progress: Progress = silent,
    until: float = math.inf,
) -> LawStudy:
    """Identify every combination of the conditions ``settings.over``, and choose the laws.

    Each alone; or all together, where a parameter is said to be shared by them.

    With an address ``settings.dask`` the combinations are identified on a cluster, see
    `mofit.identification.cells.identify_cells`.

    Parameters
    ----------
    campaign, model, settings, tests
        As for `mofit.identification.identify`.
    progress
        Called at every combination.
    until
        As for `mofit.identification.stages.locate_minima`.

    Raises
    ------
    InputError
        If a test does not state a condition, a condition does not vary, or a law does not suit.
    """
    chosen = choose_tests(model, campaign, tests)
    used = [m.name for m in campaign.measurements if m.name in chosen or _of_a_stage(model, m.kind)]
    varying_conditions(campaign.select(used), settings.over)
    groups = _groups(campaign.select(used), settings.over)
    groups = {at: names for at, names in groups.items() if set(names) & set(chosen)}
    parameters = _parameters(model, campaign.select(chosen), settings)
    calibrated = {name: stage.name for name, stage in calibrated_by(model, campaign.select(used)).items()}
    if SPECIMEN in settings.over:
        refuse_for_specimens(parameters, settings, len(groups), calibrated)
        candidates: Candidates = {}
    else:
        candidates = law_candidates(parameters, np.array(list(groups)), settings, campaign, calibrated)
    own_tests = tuple(tuple(name for name in names if name in chosen) for names in groups.values())
    blank = CellEstimates(
        parameters=tuple(parameters),
        conditions=tuple(settings.over),
        units=tuple(unit_of(campaign, name) for name in settings.over),
        at=np.array(list(groups)),
        values=np.empty((0, len(parameters))),
        covariance=np.empty((0, len(parameters), len(parameters))),
        shared=shared_names(parameters, candidates),
        wide=tuple({name for (name, _), forms in candidates.items() if any(map(_of_logarithm, forms))}),
    )
    cells = [
        Cell(_said(settings.over, at), campaign.select(names), own)
        for (at, names), own in zip(groups.items(), own_tests, strict=True)
    ]
    estimates, evaluations = _identified(campaign.select(used), cells, model, settings, blank, progress, until)
    if SPECIMEN in settings.over:
        fit, evidence = choose_populations(estimates, settings.laws)
        odd = outliers(estimates)
        return LawStudy(estimates, own_tests, fit, evidence, evaluations, populations(estimates, odd), odd)
    candidates = of_informed(estimates, candidates, [key for key in candidates if _said_law(settings, *key)])
    best = choose_laws(estimates, candidates)
    return LawStudy(estimates, own_tests, best, alternatives(estimates, best, candidates), evaluations)


def _identified(
    campaign: Campaign,
    cells: Sequence[Cell],
    model: Model,
    settings: Settings,
    blank: CellEstimates,
    progress: Progress,
    until: float,
) -> tuple[CellEstimates, int]:
    """Estimates of all combinations, and the evaluations of their searches."""
    if blank.shared:
        progress("conditions", 0, 1, f"all {len(cells)} combinations together")
        groups = {tuple(at): cell.tests for at, cell in zip(blank.at.tolist(), cells, strict=True)}
        estimates, located = identified_together(campaign, model, settings, groups, blank, until)
        progress("conditions", 1, 1, "")
        return estimates, located.search.evaluations
    found = identify_cells(cells, model, settings, blank.parameters, progress, until)
    values, covariance = np.stack([one.values for one in found]), np.stack([one.covariance for one in found])
    return replace(blank, values=values, covariance=covariance), sum(one.evaluations for one in found)


def refuse_for_specimens(
    parameters: Sequence[Parameter],
    settings: Settings,
    count: int,
    calibrated: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Raise an `InputError` with what does not suit specimens: other conditions, other laws, too few of them.

    Parameters that a stage calibrates (its name by theirs) have one value for all specimens, which is to be said.
    """
    issues = []
    if len(settings.over) > 1:
        hint = f"Pool a parameter beside laws: --per NAME={SPECIMEN} --pooled NAME"
        issues.append(Issue("--over", f"names {SPECIMEN} and other conditions", hint))
    if count < FEWEST:
        issues.append(Issue(f"--over {SPECIMEN}", f"there are {count} specimens", f"Give {FEWEST} files at least"))
    known = [one.name for one in parameters]
    for name, form in settings.laws.items():
        if name not in known:
            issues.append(Issue(f"--law {name}={form}", f"no free parameter '{name}'", did_you_mean(name, known)))
        if form not in (CONSTANT, POOLED):
            hint = f"Choose {CONSTANT} or {POOLED}"
            issues.append(Issue(f"--law {name}={form}", "specimens have no order", hint))
    for stage in dict.fromkeys(calibrated.values()):
        varied = [one for one in known if calibrated.get(one) == stage and settings.laws.get(one) != CONSTANT]
        if varied:
            constant = " ".join(f"--law {one}={CONSTANT}" for one in varied)
            hint = f"If all share them: {constant}. Else leave the tests of the stage out, or use mofit batch"
            issues.append(Issue(f"--over {SPECIMEN}", f"{', '.join(varied)}: {_CALIBRATED.format(stage)}", hint))
    raise_errors(issues)


def with_laws_of_conditions(
    campaign: Campaign, model: Model, settings: Settings, tests: Sequence[str], progress: Progress = silent
) -> tuple[Model, Settings]:
    """Model and settings with the laws that the conditions of ``settings.over`` ask for."""
    study = study_conditions(campaign, model, settings, tests, progress=progress)
    return study.model(model), replace(study.settings(settings), over=(), laws={})


def law_candidates(
    parameters: Sequence[Parameter],
    at: FloatArray,
    settings: Settings,
    campaign: Campaign,
    calibrated: Mapping[str, str] = MappingProxyType({}),
) -> Candidates:
    """Laws to choose from, of every parameter over every condition: those said, else all that the values determine.

    Parameters
    ----------
    parameters
        Free ones of the campaign.
    at
        Values of the conditions, (combinations, conditions).
    settings, campaign
        The settings say the laws; the campaign knows the units.
    calibrated
        Stage that calibrates a parameter, with a law, from the tests of all combinations.

    Raises
    ------
    InputError
        With every law that is not known, or does not suit.
    """
    issues, found = [], {}
    known = {one.name: one for one in parameters}
    for key, forms in settings.laws.items():
        name, _, condition = key.partition("@")
        if name not in (EVERY, *known):
            issues.append(Issue(f"--law {key}={forms}", f"no free parameter '{name}'", did_you_mean(name, known)))
        if condition and condition not in settings.over:
            hint = f"--over names {', '.join(settings.over) or 'none'}"
            issues.append(Issue(f"--law {key}={forms}", f"'{condition}' is no condition of --over", hint))
    for one in parameters:
        for k, condition in enumerate(settings.over):
            values = np.unique(at[:, k])
            said = _said_law(settings, one.name, condition)
            choices = tuple(form.strip() for form in said.split(",")) if said else CHOICES
            if one.name in calibrated:
                issues += _own_values(one.name, calibrated[one.name], choices if said else (), settings.laws)
                choices = tuple(form for form in choices if form != FREE)
            found[one.name, condition] = tuple(form for form in choices if said or _determined(form, values, at))
            issues += [
                issue for form in choices if said for issue in _unsuitable(one, condition, form, values, campaign)
            ]
    raise_errors(dict.fromkeys(issues))
    return found


def _said_law(settings: Settings, name: str, condition: str) -> str:
    """What the settings say of a parameter over a condition; empty where the evidence is to choose."""
    laws = settings.laws
    return laws.get(f"{name}@{condition}", laws.get(name, laws.get(EVERY, "")))


def _own_values(name: str, stage: str, said: Sequence[str], laws: Mapping[str, str]) -> list[Issue]:
    """That a calibrated parameter is to have a value per combination: said so, or as others are shared."""
    if FREE in said:
        what = f"{_CALIBRATED.format(stage)}, without a value for each"
        return [Issue(f"--law {name}={FREE}", what, "Choose another law, or leave the tests of the stage out")]
    if SHARED in laws.values() and SHARED not in said:
        what = f"{_CALIBRATED.format(stage)}; beside shared parameters it would have a value for each"
        return [Issue(f"--law {name}", what, f"Share it, too (--law {name}={SHARED}), or leave the others to laws")]
    return []


def _determined(form: str, values: FloatArray, at: FloatArray) -> bool:
    """Whether so many values determine a law; a value for each is one more than a law where there are enough."""
    if form == FREE:
        return len(at) > max(one.values for one in FORMS.values())
    return form in (CONSTANT, SHARED) or len(values) >= FORMS[form].values


def _of_logarithm(form: str) -> bool:
    return form in FORMS and FORMS[form].of_logarithm


def _unsuitable(parameter: Parameter, condition: str, form: str, values: FloatArray, campaign: Campaign) -> list[Issue]:
    if form in (CONSTANT, SHARED, FREE):
        return []
    low, high = float(values[0]), float(values[-1])
    law = Law(parameter.name, condition, form, (low + high) / 2, (high - low) / 2, unit_of(campaign, condition))
    issues = law_issues(law, parameter)
    if not issues and len(values) < FORMS[form].values:
        what = f"needs {FORMS[form].values} values of {condition}, the tests have {len(values)}"
        issues = [Issue(f"--law {parameter.name}={form}", what, "Choose linear, or add tests")]
    return issues


def unit_of(campaign: Campaign, condition: str) -> str:
    """SI unit of a condition."""
    return known_unit(condition) or campaign.units.get(condition, "1")


def _said(over: Sequence[str], at: Sequence[float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in zip(over, at, strict=True))


def _of_a_stage(model: Model, kind: str) -> bool:
    return any(kind in stage.excitations for stage in model.stages)


def _groups(campaign: Campaign, over: Sequence[str]) -> dict[tuple[float, ...], list[str]]:
    """Names of the tests of every combination of conditions, in order of the values."""
    found: dict[tuple[float, ...], list[str]] = {}
    for m in campaign.measurements:
        found.setdefault(tuple(m.experiment.conditions[name] for name in over), []).append(m.name)
    return dict(sorted(found.items()))


def _parameters(model: Model, campaign: Campaign, settings: Settings) -> list[Parameter]:
    """Free parameters of the campaign, with ranges for the data."""
    shared, _ = scoped(free_space(scaled(model, data_scales(model, campaign)), settings))
    return list(shared.parameters)
