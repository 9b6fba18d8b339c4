"""Rigs that hide an effect: simulated here, without code of mofit, diagnosed blindly, then scored."""
