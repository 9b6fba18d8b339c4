"""From what was found in memory to the result tree ``mofit.result/1``."""

from mofit.assemble.tree import assemble

__all__ = ["assemble"]
