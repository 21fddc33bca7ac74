"""The process that reads HDF5 files for this one: begun with the first, kept for all others, begun anew where a file ends it."""

from __future__ import annotations

import atexit
import contextlib
import json
import math
import os
import select
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from fcsim.apart.hdf5_content import About, Content, Group, decoded
from fcsim.apart.reading import with_our_modules
from fcsim.errors import InputError
from fcsim.files import regular
from fcsim.memory import readable
from fcsim.runtime import ISOLATED

COMMAND = "import sys; from fcsim.apart.hdf5_reader import main; sys.exit(main())"
SECONDS, SECONDS_PER_MB, PATIENCE = 10, 1.0, 300.0
"""Of the processor for one file, and of waiting on a busy machine or a slow disk."""
MEMORY, MEMORY_PER_BYTE = 2**30, 400
"""[bytes] beyond what the process begins with: the most that `read_fclib` takes of a file, twice."""
_LOCK = threading.Lock()
_PROCESS: list[subprocess.Popen[bytes]] = []


def prepare() -> None:
    """Begin the process now, so that it is there when the first file is read."""
    with _LOCK:
        _process()


def opened_apart(path: Path) -> Group:
    """What an HDF5 file holds, read in another process: see `Group`. InputError, without the path, for one that may not be read, ends its
    reader, is no HDF5 file, is damaged, or holds more than 20 000 entries."""
    content = Content(lambda name, count: _asked(path, {"name": name, "count": count}))
    about, values = _asked(path, {})
    return Group(about, "/", values, content)


def _asked(path: Path, more: About) -> tuple[About, bytearray]:
    size = regular(path).stat().st_size
    if not os.access(path, os.R_OK, effective_ids=os.access in os.supports_effective_ids):  # HDF5 takes it for damage
        raise InputError("expected a file that this user may read, got: Permission denied")
    seconds = math.ceil(SECONDS + SECONDS_PER_MB * size / 1e6)
    memory = MEMORY + MEMORY_PER_BYTE * size
    request = {"path": str(path.absolute()), "seconds": seconds, "memory": memory, **more}
    with _LOCK:
        process = _process()
        try:
            answer = _answer(process, json.dumps(request).encode() + b"\n")
        except BaseException as error:  # an interrupt, too: an answer that nobody took would be taken for the next one
            how = _ended(process)
            if isinstance(error, EOFError | BrokenPipeError):
                raise InputError(f"expected an HDF5 file, got one that ends its reader ({_why(how, seconds, memory)})") from None
            if isinstance(error, TimeoutError):
                raise InputError(f"expected an HDF5 file that can be read in {PATIENCE:g} s, its reader was still at it") from None
            raise
    about, values = answer
    if "error" in about:
        raise InputError(about["error"])
    return about, values


def _answer(process: subprocess.Popen[bytes], request: bytes) -> tuple[About, bytearray]:
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(request)
    process.stdin.flush()
    out, deadline = process.stdout, time.monotonic() + PATIENCE
    if not select.select([out], [], [], PATIENCE)[0]:
        raise TimeoutError
    about, length = out.readline(), out.readline()
    if not length.endswith(b"\n"):
        raise EOFError
    values = bytearray(int(length))
    place = memoryview(values)
    while place:
        if time.monotonic() > deadline:
            raise TimeoutError
        if not (count := out.readinto(place)):  # type: ignore[attr-defined] # IO[bytes] has no readinto, the pipe has
            raise EOFError
        place = place[count:]
    return decoded(about), values


def _process() -> subprocess.Popen[bytes]:
    if not _PROCESS or _PROCESS[0].poll() is not None:
        _PROCESS[:] = [
            subprocess.Popen(
                [sys.executable, ISOLATED, "-c", COMMAND],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=with_our_modules(),
            )
        ]
    return _PROCESS[0]


def _ended(process: subprocess.Popen[bytes]) -> int:
    """End it, if it has not ended, and say how it did."""
    _forget()
    try:
        return process.wait(0.5)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _why(code: int, seconds: int, memory: float) -> str:
    if code == -signal.SIGXCPU:
        return f"more than {seconds} s of the processor"
    name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return f"{name}; it may take {readable(memory)} of memory"


def _forget() -> None:
    for process in _PROCESS:
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):  # of what it had not taken yet
                    pipe.close()
    _PROCESS.clear()


def _in_a_fork() -> None:
    """A fork has a process of its own: two that read one pipe would take each other's answers."""
    global _LOCK
    _LOCK = threading.Lock()
    for process in _PROCESS:
        process.returncode = 0  # it is not a child of this one
    _forget()


def _at_the_end() -> None:
    for process in list(_PROCESS):
        _ended(process)


os.register_at_fork(after_in_child=_in_a_fork)
atexit.register(_at_the_end)
