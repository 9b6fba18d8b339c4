"""Global search: find every region of the box that is worth refining."""

from mofit.search.clusters import Clustering, cluster
from mofit.search.effa import PAPER, EffaSettings, effa
from mofit.search.front import nondominated
from mofit.search.hypervolume import hypervolume, hypervolume_history
from mofit.search.niching import NichingSettings, niching
from mofit.search.result import Iteration, SearchResult
from mofit.search.surrogate import SurrogateSettings, surrogate

__all__ = [
    "PAPER",
    "Clustering",
    "EffaSettings",
    "Iteration",
    "NichingSettings",
    "SearchResult",
    "SurrogateSettings",
    "cluster",
    "effa",
    "hypervolume",
    "hypervolume_history",
    "niching",
    "nondominated",
    "surrogate",
]
