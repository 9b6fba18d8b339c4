"""Shipped effects: what a model may leave out, one short file each."""
