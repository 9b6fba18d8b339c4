"""The plan file of the virtual test rig: which model, which effects, which noise, which tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from mofit.errors import Fault, did_you_mean
from mofit.labels import KINDS
from mofit.readers.map_file import Quantity
from mofit.toml_file import read_toml

DOCS = "docs/models.md lists every key"

#: keys that a test of a kind needs, beside name, kind and sample_rate
NEEDED = {
    "step": ("amplitude", "ramp_rate", "duration"),
    "quasi_static": ("amplitude", "ramp_rate"),
    "sine": ("amplitude", "frequency"),
    "chirp": ("amplitude", "frequency", "last_frequency", "duration"),
    "multisine": ("amplitude", "frequency", "lines"),
}

#: keys of which a test of a kind needs exactly one
EITHER = {"sine": ("periods", "duration"), "multisine": ("periods", "duration")}

_COMMON = {"name", "kind", "sample_rate", "conditions"}
_ALSO = {"step": {"delay"}}


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class EffectPlan(_Strict):
    """An effect by name, the values of its parameters (nominal where left out) and the kinds of tests that it joins.

    Without ``kinds`` it joins all tests.
    """

    name: str
    parameters: dict[str, Quantity] = Field(default_factory=dict)
    kinds: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _known_kinds(self) -> EffectPlan:
        for kind in self.kinds:
            if kind not in NEEDED:
                raise ValueError(f"unknown kind '{kind}'. {did_you_mean(kind, NEEDED)}")
        return self


class NoisePlan(_Strict):
    """Noise of one channel: white, growing with the level, and coloured, all independent.

    Attributes
    ----------
    sd
        Of the white part, in the channel's unit.
    fraction
        Of the white part, as a share of the channel's peak-to-peak range in the test; adds to ``sd``.
    level
        Of a white part that is proportional to the magnitude of the signal.
    coloured_sd, coefficient
        Of a first-order autoregressive part, and its correlation from sample to sample.
    """

    sd: Quantity = 0.0
    fraction: float = Field(0.0, ge=0)
    level: float = Field(0.0, ge=0)
    coloured_sd: Quantity = 0.0
    coefficient: float = Field(0.9, ge=0, lt=1)


class TestPlan(_Strict):
    """One test; which keys it needs depends on its kind, see `NEEDED`."""

    name: str
    kind: str
    sample_rate: Quantity
    amplitude: Quantity | None = None
    frequency: Quantity | None = None
    last_frequency: Quantity | None = None
    lines: tuple[int, ...] | None = None
    periods: float | None = Field(None, gt=0)
    duration: Quantity | None = None
    ramp_rate: Quantity | None = None
    delay: Quantity | None = None
    conditions: dict[str, Quantity] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _keys_of_the_kind(self) -> TestPlan:
        if self.kind not in NEEDED:
            cure = did_you_mean(self.kind, NEEDED) if self.kind not in KINDS else f"Plans know {', '.join(NEEDED)}"
            raise ValueError(f"unknown kind '{self.kind}'. {cure}")
        given = {key for key in type(self).model_fields if getattr(self, key) not in (None, {})} - _COMMON
        needed, either = set(NEEDED[self.kind]), set(EITHER.get(self.kind, ()))
        wrong = [f"{self.kind} needs '{key}'" for key in sorted(needed - given)]
        if either and len(either & given) != 1:
            wrong.append(f"{self.kind} needs either 'periods' or 'duration'")
        spare = given - needed - either - _ALSO.get(self.kind, set())
        wrong += [f"{self.kind} has no use for '{key}'" for key in sorted(spare)]
        if wrong:
            raise ValueError("; ".join(wrong))
        return self


class Plan(_Strict):
    """A whole plan. ``defaults`` holds entries that every test takes where its kind has a use for them.

    ``pause`` is the time between tests [s]; ``noise`` is by channel.
    """

    title: str
    model: str
    seed: int = Field(ge=0)
    parameters: dict[str, Quantity] = Field(default_factory=dict)
    conditions: dict[str, Quantity] = Field(default_factory=dict)
    effects: tuple[EffectPlan, ...] = ()
    noise: dict[str, NoisePlan] = Field(default_factory=dict)
    attributes: dict[str, str | float | int] = Field(default_factory=dict)
    pause: Quantity = 0.0
    tests: tuple[TestPlan, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _names_differ(self) -> Plan:
        names = [test.name for test in self.tests]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"test names are used twice: {', '.join(twice)}")
        return self


def read_plan(path: Path) -> Plan:
    """Read a plan and check its keys.

    Raises
    ------
    InputError
        With every fault: no file, no TOML, unknown or missing keys, values of the wrong kind.
    """
    return read_toml(path, "plan", Plan, with_defaults, _fault)


def with_defaults(content: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a file with its ``defaults`` spread over the ``tests`` whose kind has a use for them."""
    rest = {key: value for key, value in content.items() if key != "defaults"}
    defaults, tests = content.get("defaults"), content.get("tests")
    if isinstance(defaults, dict) and isinstance(tests, list):
        rest["tests"] = [{**_of_use(defaults, test), **test} if isinstance(test, dict) else test for test in tests]
    return rest


def _of_use(defaults: Mapping[str, Any], test: Mapping[str, Any]) -> dict[str, Any]:
    """The defaults that the test's kind has a use for; of two rivals the test's own stands alone."""
    kind = test.get("kind", defaults.get("kind"))
    either = set(EITHER.get(str(kind), ()))
    useful = _COMMON | set(NEEDED.get(str(kind), ())) | either | _ALSO.get(str(kind), set())
    if either & set(test):
        useful -= either
    # a key that no kind knows stays, so that it is found out
    return {key: value for key, value in defaults.items() if key in useful or key not in TestPlan.model_fields}


def _fault(where: str, problem: Mapping[str, Any]) -> Fault:
    parts = [str(part + 1) if isinstance(part, int) else str(part) for part in problem["loc"]]
    place = f"{where}, {'.'.join(parts)}" if parts else where
    if problem["type"] == "extra_forbidden":
        top = problem["loc"][0]
        kinds: dict[object, type[BaseModel]] = {"tests": TestPlan, "effects": EffectPlan, "noise": NoisePlan}
        known = [*kinds[top].model_fields] if len(parts) > 1 and top in kinds else [*Plan.model_fields, "defaults"]
        return Fault(place, "unknown key", did_you_mean(parts[-1], known))
    if problem["type"] == "missing":
        return Fault(place, "missing", f"Add it; {DOCS}")
    return Fault(place, str(problem["msg"]).removeprefix("Value error, "), f"Mend it; {DOCS}")
