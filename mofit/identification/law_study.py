"""What identifying every combination of conditions alone told, and the laws that were chosen from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from mofit.identification.law_fit import CellEstimates, LawFit
from mofit.identification.population import POOLED, Outlier, Population
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
    populations: tuple[Population, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    """Of specimens: every parameter over them, and those that stand out."""

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws with coefficients."""
        return self.fit.laws

    def model(self, model: Model) -> Model:
        """The model whose parameters follow the laws."""
        return with_laws(model, self.laws)

    def settings(self, settings: Settings) -> Settings:
        """The settings of the joint identification: free and pooled parameters have a value per combination."""
        pooled = tuple(name for (name, _), form in self.fit.forms.items() if form == POOLED)
        scopes = {name: ",".join(self.cells.conditions) for name in (*self.fit.free, *pooled)}
        return replace(settings, scopes={**settings.scopes, **scopes}, pooled=(*settings.pooled, *pooled))
