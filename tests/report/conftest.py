"""Make the synthetic results importable whatever pytest's import mode is."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "result"))
