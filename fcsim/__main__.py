"""The program `fcsim`, and python -m fcsim, as mpi4py.futures starts it."""

from __future__ import annotations

import signal
import sys

from fcsim.errors import EXIT_BAD_INPUT, InputError
from fcsim.memory import refuse_to_load_the_core


def run() -> int:
    """Load the command line, which takes a second, and run it; the exit code. Ctrl-C while it is loaded ends it by a line, too, as does a
    limit on the memory in which it cannot be loaded; Ctrl-C once the answer is given ends the process at once, without a traceback of
    what Python does last."""
    try:
        refuse_to_load_the_core()
        from fcsim.command_line.main import main

        return main()
    except KeyboardInterrupt:
        print("fcsim: interrupted by the keyboard", file=sys.stderr)
        return 130
    except InputError as error:
        print(f"fcsim: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    finally:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, signal.SIG_DFL)


if __name__ == "__main__":
    raise SystemExit(run())
