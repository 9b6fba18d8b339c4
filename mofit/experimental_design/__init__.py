"""Optimal experimental design: expected uncertainty of planned tests, comparison of experiments, the next tests."""
