"""The program `fcsim`, and python -m fcsim, as mpi4py.futures starts it."""

from __future__ import annotations

import sys


def run() -> int:
    """Load the command line, which takes a second, and run it; the exit code. Ctrl-C while it is loaded ends it by a line, too."""
    try:
        from fcsim.command_line.main import main
    except KeyboardInterrupt:
        print("fcsim: interrupted by the keyboard", file=sys.stderr)
        return 130
    return main()


if __name__ == "__main__":
    raise SystemExit(run())
