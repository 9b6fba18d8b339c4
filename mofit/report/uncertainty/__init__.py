"""The sections that only the uncertainty page has: intervals, predictive bands, homogeneity of the tests."""
