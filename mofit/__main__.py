"""``python -m mofit`` is the command ``mofit``."""

from mofit.cli import main

if __name__ == "__main__":
    main()
