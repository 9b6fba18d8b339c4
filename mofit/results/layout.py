"""What a layout is made of: variables with their dimensions, units and names, and groups of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

#: units of a variable over parameters: each has its own, which the coordinate ``unit`` beside it names
OWN_UNIT = "as unit"

#: the same of a variable over outputs: the coordinate ``output_unit`` names them
OUTPUT_UNIT = "as output_unit"


@dataclass(frozen=True)
class Variable:
    """A variable of a group.

    Parameters
    ----------
    dims
        Names of the dimensions, separated by spaces; ``{stage}`` is the name of a calibration stage, and ``[output]``
        is there only where the model has several outputs.
    units
        SI unit, ``"1"`` without one; empty where it depends on the model or the campaign.
    long_name
        What it is, in a few words; empty where it depends on the model.
    required
        Whether a result without it is refused; of a group that is there.
    """

    dims: str
    units: str
    long_name: str
    required: bool = True

    def over(self, stage: str, several: bool) -> tuple[str, ...]:
        """Its dimensions in a group of a stage, of a model with one output or with ``several``."""
        return tuple(self.dims.format(stage=stage).replace("[output]", "output" if several else "").split())


optional = partial(Variable, required=False)


@dataclass(frozen=True)
class Group:
    """Variables of a group by name, its required attributes, and whether every result has it."""

    variables: Mapping[str, Variable] = field(default_factory=dict)
    attributes: tuple[str, ...] = ()
    required: bool = False
