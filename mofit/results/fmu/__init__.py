"""FMUs of an identified model: its variables, description, C source and binary, in one archive."""
