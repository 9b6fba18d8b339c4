"""The whole identification, data to posterior, by mofit and as users of other tools would write it."""
