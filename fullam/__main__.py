"""`python -m fullam` is the command `fullam`."""

import sys

from fullam.cli import main

if __name__ == "__main__":
    sys.exit(main())
