"""Files of rigs and colleagues into campaigns, told by a map file (see docs/campaigns.md)."""

from mofit.readers.guess import guess_map
from mofit.readers.importing import import_files
from mofit.readers.map_file import ImportMap, read_map
from mofit.readers.table import Table, read_table

__all__ = ["ImportMap", "Table", "guess_map", "import_files", "read_map", "read_table"]
