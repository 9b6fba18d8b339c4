"""Pages of comparisons and designs."""
