"""Global search: find every region of the box that is worth refining."""

from mofit.search.archive import nondominated
from mofit.search.clusters import Clustering, cluster
from mofit.search.effa import PAPER, EffaSettings, effa
from mofit.search.result import Iteration, SearchResult

__all__ = ["PAPER", "Clustering", "EffaSettings", "Iteration", "SearchResult", "cluster", "effa", "nondominated"]
