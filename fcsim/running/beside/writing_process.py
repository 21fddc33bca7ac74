"""A process of its own that writes the FCLIB files of a run beside its steps.

HDF5 keeps the interpreter's lock while it writes, and so would a thread keep it from what computes the next step. The process has the
arrays over pipes, writes each file whole and answers what came of it. It is there for as long as the run: a run that is killed closes its
end of the pipe, and the process ends after the file that it is at. Signals that end the run are not its own: the run waits for it.
"""

from __future__ import annotations

import contextlib
import pickle
import select
import signal
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from fcsim.apart.reading import with_our_modules
from fcsim.export_fclib.chunks import Compressor
from fcsim.running.fclib_series import StepFile
from fcsim.runtime import ISOLATED

_IGNORED = "import signal, sys; [signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]"
COMMAND = f"{_IGNORED}; from fcsim.running.beside.writing_process import main; sys.exit(main())"
PATIENCE = 60.0
"""[s] that the process has to end once nothing more comes."""
_SIZE = struct.Struct("<Q")


class WritingProcess:
    """The process, from the side of the run. Errors of a file are raised by `write`, OSError where the process itself has ended."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, ISOLATED, "-c", COMMAND], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=with_our_modules()
        )
        self._began = False

    @property
    def number(self) -> int:
        """Of the process."""
        return self._process.pid

    @property
    def ready(self) -> bool:
        """Whether it has begun, and waits for files: that takes a second, and does not hold up a short run. False for ever where it could
        not begin."""
        out = self._process.stdout
        assert out is not None
        if not self._began and not out.closed and select.select([out], [], [], 0)[0]:
            with contextlib.suppress(EOFError, OSError):
                _receive(out)
                self._began = True
        return self._began

    def write(self, file: StepFile) -> Path:
        """Write a file, and return when it is written."""
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            _send(self._process.stdin, file.bare())
            answer = _receive(self._process.stdout)
        except (EOFError, BrokenPipeError):
            raise OSError(f"{file.folder / file.name}: the process that writes FCLIB files has ended ({self._how()})") from None
        if isinstance(answer, BaseException):
            raise answer
        assert isinstance(answer, Path)
        return answer

    def end(self) -> None:
        """Return when the process has ended."""
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()  # type: ignore[union-attr]  # there are both
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:  # a fork of the run has the pipe still, or the disk hangs
            self._process.kill()
            self._process.wait()

    def _how(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(1.0)
            return signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return "it answers no more"


def main() -> int:
    """The process: files come on standard input, what came of each goes to standard output; what else would be written there is not."""
    taken, given = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr
    compressor = Compressor()
    with contextlib.suppress(EOFError, BrokenPipeError):
        _send(given, None)
        while True:
            file = _receive(taken)
            assert isinstance(file, StepFile)
            answer: object
            try:
                answer = file.write(compressor)
            except Exception as error:
                answer = _sendable(error)
            _send(given, answer)
    return 0


def _sendable(error: Exception) -> Exception:
    """The error, or one of the same text where it is none that another process can make again."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _send(pipe: IO[bytes], value: object) -> None:
    """Write a value: the number of its buffers and their sizes, then the buffers, arrays as they lie in memory."""
    arrays: list[pickle.PickleBuffer] = []
    text = pickle.dumps(value, protocol=5, buffer_callback=arrays.append)
    buffers: Sequence[memoryview] = [memoryview(text), *(array.raw() for array in arrays)]
    pipe.write(b"".join(_SIZE.pack(size) for size in (len(buffers), *(buffer.nbytes for buffer in buffers))))
    for buffer in buffers:
        pipe.write(buffer)
    pipe.flush()


def _receive(pipe: IO[bytes]) -> object:
    """Read a value that `_send` has written; EOFError where nothing comes any more. Only what this program itself writes is read so."""
    (count,) = _SIZE.unpack(_bytes(pipe, _SIZE.size))
    sizes = [_SIZE.unpack(_bytes(pipe, _SIZE.size))[0] for _ in range(count)]
    text, *arrays = [_bytes(pipe, size) for size in sizes]
    value: object = pickle.loads(text, buffers=arrays)
    return value


def _bytes(pipe: IO[bytes], size: int) -> bytearray:
    found = bytearray(size)
    place = memoryview(found)
    while place:
        if not (count := pipe.readinto(place)):  # type: ignore[attr-defined]  # of a buffered pipe
            raise EOFError
        place = place[count:]
    return found
