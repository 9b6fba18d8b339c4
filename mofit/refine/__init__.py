"""Local refinement: from start points to distinct minima, with exact gradients and bounds."""

from mofit.refine.closeness import Closeness
from mofit.refine.merge import MergeSettings, merge
from mofit.refine.refine import RefineSettings, refine
from mofit.refine.result import Minimum, Refined

__all__ = ["Closeness", "MergeSettings", "Minimum", "RefineSettings", "Refined", "merge", "refine"]
