"""Programs of this folder one after the other on the same ranks, `together.py FOLDER NAME ...`: each writes into FOLDER/NAME."""

import sys
from importlib import import_module
from pathlib import Path

from fcsim.ranks import sharing

if __name__ == "__main__":
    with sharing():
        for name in sys.argv[2:]:
            import_module(f"tests.unit.ranks.{name}").main(Path(sys.argv[1], name))
