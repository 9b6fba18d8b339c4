"""What identifying every combination of conditions alone told, and the laws that were chosen from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from mofit.identification.law_fit import CellEstimates, LawFit
from mofit.identification.settings import Settings
from mofit.models import Law, Model, with_laws


@dataclass(frozen=True)
class LawStudy:
    """What identifying every combination of conditions alone told."""

    cells: CellEstimates
    tests: tuple[tuple[str, ...], ...]
    """Of every combination."""
    fit: LawFit
    """The laws chosen."""
    evidence: Mapping[tuple[str, str], Mapping[str, float]]
    """Log evidence of every candidate relative to that, by parameter and condition."""
    evaluations: int
    """Of all searches."""

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws with coefficients."""
        return self.fit.laws

    def model(self, model: Model) -> Model:
        """The model whose parameters follow the laws."""
        return with_laws(model, self.laws)

    def settings(self, settings: Settings) -> Settings:
        """The settings of the joint identification: free parameters have a value per combination."""
        scopes = {name: ",".join(self.cells.conditions) for name in self.fit.free}
        return replace(settings, scopes={**settings.scopes, **scopes})
