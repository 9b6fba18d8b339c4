"""Global searches, local refinement to distinct minima, and profile likelihoods, in the unit cube."""

from mofit.optimize.global_search import STAGES, Progress, SearchResult, only_point
from mofit.optimize.levenberg_marquardt import RefineSettings, minimise_each, refine
from mofit.optimize.local_minima import Minimum, merge
from mofit.optimize.pareto_front import hypervolume_history
from mofit.optimize.profile_likelihood import Profile, profile

__all__ = [
    "STAGES",
    "Minimum",
    "Profile",
    "Progress",
    "RefineSettings",
    "SearchResult",
    "hypervolume_history",
    "merge",
    "minimise_each",
    "only_point",
    "profile",
    "refine",
]
