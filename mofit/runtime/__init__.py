"""What every job needs around its numbers: processes, progress, log, run directory, TOML."""
