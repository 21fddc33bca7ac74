"""Python's signal handlers, which libraries take."""

from __future__ import annotations

import signal
import threading


def restore_signal_handlers() -> None:
    """Install Python's handlers again, ignored signals included: gmsh's library replaces those of SIGTERM, SIGPIPE and others when it
    starts and when it ends."""
    if threading.current_thread() is threading.main_thread():
        for number in signal.valid_signals():
            handler = signal.getsignal(number)
            if callable(handler) or handler == signal.SIG_IGN:
                signal.signal(number, handler)
