"""How comparisons and designs show themselves in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

from mofit.experimental_design.comparison_result import Comparison
from mofit.experimental_design.design_job import Proposal
from mofit.experimental_design.summary import design_summary
from mofit.experimental_design.text import augmentation_sentences, criterion_text, settings_text, target_text
from mofit.workflows.shown import picture, summary, view

if TYPE_CHECKING:
    import pandas as pd

#: columns of the tables that are shown, of a comparison or a design
_COLUMNS = ("sd_before", "sd", "unit", "relative_sd_before", "relative_sd", "verdict")


class _Shown:
    """A comparison or a design whose text is its table."""

    @classmethod
    def of(cls, found: Comparison | Proposal) -> Self:
        """The same, shown."""
        return cls(**vars(found))

    def __repr__(self) -> str:
        return str(_brief(self))  # type: ignore[arg-type]


class ShownComparison(_Shown, Comparison):
    """A comparison that a notebook shows with its sentences, table and figure."""

    def _repr_html_(self) -> str:
        table = summary(self)
        lost = [f"{name} is not identifiable from any of these experiments." for name in self.not_identifiable]
        model = self.sources[0].source.model
        return view(
            f"Experiments compared: {model.title or model.name}",
            [*lost, *augmentation_sentences(self), *self.notes],
            [_brief(self)],
            _figures(table),
        )


class ShownProposal(_Shown, Proposal):
    """A design that a notebook shows with its tests, what they give, and a figure."""

    def _repr_html_(self) -> str:
        import pandas as pd

        said, table = design_summary(self), summary(self)
        rows = [
            {"kind": test["kind"], "settings": settings_text(test), "times": test["times"], "seconds": test["seconds"]}
            for test in said["design"]
        ]
        tests = pd.DataFrame(rows, index=pd.Index([test["name"] for test in said["design"]], name="run next"))
        return view(
            "Next tests for " + ", ".join(said["criterion"]["of"]) + target_text(said),
            [*said["not_identifiable"], criterion_text(said), *self.notes],
            [tests, _brief(self)],
            _figures(table),
        )


def _brief(found: Comparison | Proposal) -> pd.DataFrame:
    """What a reader looks at first."""
    table = summary(found)
    return table[[name for name in _COLUMNS if name in table]]


def _figures(table: pd.DataFrame) -> list[tuple[str, str]]:
    from mofit import plots

    return [("expected standard deviations", picture(lambda ax: plots.expected_sd(table, ax)))]
