"""The gap between measured and simulated: where it lies, which effect causes it, how far it shrinks."""
