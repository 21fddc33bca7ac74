"""Locks that processes which are forked find open."""

from __future__ import annotations

import os
import threading


def lock_over_forks() -> threading.Lock:
    """A lock that no fork takes along closed: the thread that would open it is not in the child."""
    lock = threading.Lock()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)
    return lock
