"""A proposal as a file that ``--effect`` and ``--effects`` take: what a user would write by hand."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill, indent

from mofit.diagnosis.proposal import Proposal
from mofit.diagnosis.terms import TermEffect
from mofit.models import TARGET_UNIT, Channel
from mofit.parameters import Parameter

EFFECT_FILE = "proposed_effect.py"
_WIDTH = 116
#: Ranges in the file reach to so many times the estimate, or over such a part of those that were tried.
_NEAR = 10.0


def effect_file(proposal: Proposal, campaign: str, model: str) -> str:
    """The text of the file, with where it comes from and how far it shrinks the gap."""
    effect = proposal.effect
    beside = f" beside {' and '.join(proposal.beside)}" if proposal.beside else ""
    origin = (
        f"Learnt from the campaign '{campaign}' with the model {model}{beside}: {proposal.law}. On "
        f"{proposal.held_out} it removes {100 * proposal.removed:.1f} % of the gap "
        f"({100 * proposal.low:.1f} to {100 * proposal.high:.1f} %). A proposal: it describes these data, and need not "
        "be the cause."
    )
    others = "".join(f"--effect {name} " for name in proposal.beside)
    casadi = "import casadi as ca\n\n" if "ca." in _body(effect) else ""
    channels = "Channel, " if effect.states or effect.inputs else ""
    return f'''"""A term that mofit diagnose proposes: copy, change, run.

{fill(_plain(origin), _WIDTH)}

mofit diagnose campaign.nc --effects {EFFECT_FILE}
mofit identify campaign.nc {others}--effect {EFFECT_FILE}
"""

{casadi}from mofit.models import TARGET_UNIT, Applied, {channels}Effect
from mofit.parameters import Parameter


class Proposed(Effect):
    """What is added to {effect.target.name}."""

    name = "{effect.name}"
    title = "{effect.title}"
    on = ("{effect.target.name}",)
    needs = ({"".join(f'"{name}", ' for name in effect.needs).strip()})
    parameters = (
{"".join(indent(_parameter(one), " " * 8) for one in effect.parameters)}    )
{_channels("inputs", effect.inputs)}{_channels("states", effect.states)}
    def apply(self, s, value):
        """The quantity with the term; signals are relative to their largest magnitude in the data."""
{indent(_body(effect), " " * 8)}'''


def _plain(text: str) -> str:
    return text.replace("\\", "/").replace('"', "'")


def _parameter(one: Parameter) -> str:
    """A parameter in Python."""
    unit = "TARGET_UNIT" if one.unit == TARGET_UNIT else f'"{one.unit}"'
    numbers = ", ".join(f"{value:.6g}" for value in (*_range(one), one.nominal))
    rest = f'description="{one.description}"' + (", neutral=0.0" if one.neutral is not None else "")
    scale = ', "log"' if one.scale == "log" else ""
    return f'Parameter(\n    "{one.name}", {unit}, {numbers}{scale},\n    {rest},\n),\n'


def _range(one: Parameter) -> tuple[float, float]:
    """A range around the estimate, which an identification finds quickly; it widens it where that is needed."""
    if one.scale == "log":
        return max(one.lower, one.nominal / _NEAR), min(one.upper, one.nominal * _NEAR)
    if one.neutral is not None:
        reach = min(_NEAR * abs(one.nominal), one.upper)
        return -reach, reach
    reach = (one.upper - one.lower) / _NEAR
    return max(one.lower, one.nominal - reach), min(one.upper, one.nominal + reach)


def _channels(group: str, channels: Sequence[Channel]) -> str:
    """A group of channels in Python; nothing where there are none."""
    lines = "".join(f"        {_channel(one)},\n" for one in channels)
    return f"    {group} = (\n{lines}    )\n" if lines else ""


def _channel(one: Channel) -> str:
    rest = f', derivative_of="{one.derivative_of}"' if one.derivative_of else ""
    return f'Channel("{one.name}", "{one.unit}", "{one.description}"{rest})'


def _body(effect: TermEffect) -> str:
    """What ``apply`` does."""
    signals = [("value" if one.is_output else f"s.{one.name}", one) for one in effect.variables]
    lines = [f"{one.name} = {signal} / {one.scale:.8g}  # {one.unit}" for signal, one in signals]
    lines.append(f"term = {effect.terms[0].text}")
    lines += [f"term += {one.text}" for one in effect.terms[1:]]
    if not effect.stateful:
        return "\n".join([*lines, "return Applied(value + term)\n"])
    derivatives = ", ".join(f'"{one.state}": {one.drives}' for one in effect.stateful)
    initial = ", ".join(f'"{one.state}": {one.starts}' for one in effect.stateful)
    return "\n".join([*lines, f"return Applied(value + term, {{{derivatives}}}, initial={{{initial}}})\n"])
