"""Sixty made-up systems: their truth, an independent simulator, a user's model files, and the judge of the results."""
