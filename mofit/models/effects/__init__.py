"""Shipped effects, what a model may leave out: one class each, a file per kind of physics."""
