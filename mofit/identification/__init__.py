"""Identification of one campaign: calibrate, search, refine, sample, assemble the result tree."""
