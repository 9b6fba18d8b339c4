"""Simulators of one's own: evaluations that are counted and remembered, slopes by differences, an emulator."""
