"""Peers of a diagnosis: each gets the baseline's residuals and says what it can of the gap."""
