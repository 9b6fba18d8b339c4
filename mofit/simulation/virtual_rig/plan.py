"""The plan file of the virtual test rig: which model, which effects, which noise, which tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, model_validator

from mofit.errors import did_you_mean
from mofit.quantities import EXCITATION_KINDS
from mofit.runtime.toml import Strict, read_toml, toml_key, toml_value
from mofit.units import Quantity

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

#: keys that a test of a kind may have beside them
OPTIONAL = {"step": ("delay",)}

_COMMON = {"name", "kind", "sample_rate", "conditions"}


#: keys of a test of any kind that takes its inputs from a record, beside name and kind
RECORDED = ("record", "test")


def _known(kind: str) -> str:
    if kind not in EXCITATION_KINDS:
        raise ValueError(f"unknown kind '{kind}'. {did_you_mean(kind, EXCITATION_KINDS)}")
    return kind


Kind = Annotated[str, AfterValidator(_known)]


class EffectPlan(Strict):
    """An effect, the values of its parameters (nominal where left out) and the kinds of tests that it joins (all)."""

    name: str
    parameters: dict[str, Quantity] = Field(default_factory=dict)
    kinds: tuple[Kind, ...] = ()


class NoisePlan(Strict):
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


class TestPlan(Strict):
    """One test; which keys it needs depends on its kind, see `NEEDED`.

    A test of any kind may take its inputs from a measured one instead: ``record`` is a campaign file, relative to the
    plan's folder, and ``test`` the name of a test in it.
    """

    name: str
    kind: Kind
    record: str | None = None
    test: str | None = None
    sample_rate: Quantity | None = None
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
        given = {key for key in type(self).model_fields if getattr(self, key) not in (None, {})} - _COMMON
        if given & set(RECORDED):
            return self._keys_of_a_record(given)
        if self.kind not in NEEDED:
            raise ValueError(f"{self.kind} needs 'record', and 'test'. Plans can make {', '.join(NEEDED)}")
        needed, either = set(NEEDED[self.kind]), set(EITHER.get(self.kind, ()))
        absent = [*sorted(needed - given), *(["sample_rate"] if self.sample_rate is None else [])]
        wrong = [f"{self.kind} needs '{key}'" for key in absent]
        if either and len(either & given) != 1:
            wrong.append(f"{self.kind} needs either 'periods' or 'duration'")
        spare = given - needed - either - set(OPTIONAL.get(self.kind, ()))
        wrong += [f"{self.kind} has no use for '{key}'" for key in sorted(spare)]
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    def beside(self, folder: Path) -> TestPlan:
        """The test with its record found from the folder of the plan."""
        return self if self.record is None else self.model_copy(update={"record": str(folder / self.record)})

    def _keys_of_a_record(self, given: set[str]) -> TestPlan:
        wrong = [f"an input from a record needs '{key}'" for key in RECORDED if key not in given]
        spare = given - set(RECORDED) | ({"sample_rate"} if self.sample_rate is not None else set())
        wrong += [f"an input from a record has no use for '{key}'" for key in sorted(spare)]
        if wrong:
            raise ValueError("; ".join(wrong))
        return self


class Plan(Strict):
    """A whole plan; ``pause`` is the time between tests [s], ``noise`` is by channel."""

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
        With every issue: no file, no TOML, unknown or missing keys, values of the wrong kind.
    """
    plan = read_toml(path, "plan", Plan, "docs/models.md", with_defaults)
    tests = [test.beside(path.parent) for test in plan.tests]
    return plan.model_copy(update={"tests": tuple(tests)})


def with_defaults(defaults: Mapping[str, Any], test: Mapping[str, Any]) -> dict[str, Any]:
    """A test with the defaults that its kind can use; a default does not compete with an alternative of the test."""
    if set(RECORDED) & set(test):
        kept = {key: value for key, value in defaults.items() if key in {"kind", "conditions", *RECORDED}}
        return {**kept, **test}
    kind = str(test.get("kind", defaults.get("kind")))
    either = set(EITHER.get(kind, ()))
    useful = _COMMON | set(NEEDED.get(kind, ())) | either | set(OPTIONAL.get(kind, ()))
    if either & set(test):
        useful -= either
    # a key that no kind knows stays, so that it is reported
    kept = {key: value for key, value in defaults.items() if key in useful or key not in TestPlan.model_fields}
    return {**kept, **test}


def plan_text(plan: Plan, comment: str = "") -> str:
    """The plan as TOML that `read_plan` turns into the same plan; ``comment`` heads the file."""
    entries = plan.model_dump(exclude_none=True)
    tables = {key: entries.pop(key) for key in ("attributes", "conditions", "parameters", "noise", "effects", "tests")}
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    lines += ["", *_pairs(entries)] if lines else _pairs(entries)
    for key in ("attributes", "conditions", "parameters"):
        lines += ["", f"[{key}]", *_pairs(tables[key])] if tables[key] else []
    for channel, entry in tables["noise"].items():
        lines += ["", f"[noise.{toml_key(channel)}]", *_pairs(entry)]
    for key in ("effects", "tests"):
        for entry in tables[key]:
            lines += ["", f"[[{key}]]", *_pairs(entry)]
    return "\n".join(lines) + "\n"


def _pairs(entries: Mapping[str, Any]) -> list[str]:
    """``key = value`` lines; empty tables are left out."""
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in entries.items() if value != {}]
