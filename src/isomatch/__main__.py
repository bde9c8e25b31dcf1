"""``python -m isomatch`` is the command line."""

import sys

from isomatch.cli import main

if __name__ == "__main__":
    sys.exit(main())
