"""``python -m isomatch.warm``: the command ``isomatch warm``."""

import sys
from runpy import run_module

if __name__ == "__main__":
    sys.argv.insert(1, "warm")
    run_module("isomatch", run_name="__main__")
