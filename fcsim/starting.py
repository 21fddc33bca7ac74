"""Ctrl-C while the package is loaded by the program fcsim: it ends the process as it ends any other, without a traceback of imports.

Loaded before all else; scripts that import fcsim are let alone.
"""

import signal
import sys
from contextlib import suppress

_PROGRAM = getattr(sys, "argv", [""])[0].rpartition("/")[2] in ("fcsim", "-m")


def ends_at_once() -> None:
    """Let the system end the program, if Python would answer Ctrl-C and nobody else."""
    if _PROGRAM and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        with suppress(ValueError):  # not in the main thread
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def listens() -> None:
    """Let Python answer again: the package is there, and `run` says what ended it."""
    if _PROGRAM and signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        with suppress(ValueError):
            signal.signal(signal.SIGINT, signal.default_int_handler)


ends_at_once()
