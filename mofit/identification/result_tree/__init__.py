"""From what was found in memory to the result tree ``mofit.result/2``."""

from mofit.identification.result_tree.tree import assemble

__all__ = ["assemble"]
