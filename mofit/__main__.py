"""``python -m mofit`` is the command ``mofit``."""

import sys

from mofit.cli import main

if __name__ == "__main__":
    sys.exit(main())
