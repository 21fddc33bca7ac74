"""The ranks that share a simulation, and what they exchange.

* All exchanges are made by every rank in the same order. Each begins with what it is for: ranks that have drifted apart notice, and stop.
* A rank waits awake: it hears signals, and others that have ended, and takes no core while it waits.
* Results do not depend on the number of ranks: what is gathered stands in the order of bodies, and what is summed has at most two terms
  that are not zero in every place (a contact's two bodies), whose sum does not depend on their order. Where W is distributed, which terms
  there are depends on the ranks: those results are the same within the solver's tolerance, and still bit by bit on all ranks of one run.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import FcsimError
from fcsim.interrupts import Ended, held_back
from fcsim.ranks.digest import lanes
from fcsim.ranks.mapped_memory import CommonMemory
from fcsim.ranks.neighbours import gone, on_this_machine, stopped, this_process

AWAKE, SOON = 5e-4, 1e-2
BRIEF, NAP = 2e-5, 2e-4
"""[s] A rank that waits looks again and again for so long, then, until SOON, after brief naps, and after that after longer ones. What has
come is heard of 0.09 ms later by the former (a system adds 0.05 ms to each), 0.25 by the latter."""
GRACE = 2.0
"""[s] What others have sent before they ended arrives within it."""
LAST_WAIT = 20.0
"""[s] A rank that ended by an error waits so long for the others to end by themselves; then it ends them."""
LAST_WORD = 2.0
"""[s] The launcher ends all ranks where one ends with an error; rank 0, which has to say why, goes first."""
LOOK = 1.0
"""[s] So often a rank that waits looks whether the others' processes on its machine are still there."""
HELD = 5.0
"""[s] A rank whose process is stopped for so long is named: the others wait for it, which may be what somebody wants."""
SUMMED_AT_ONCE = 4_000_000
"""Numbers (32 MB)."""
_ENDED = 77


class _Request(Protocol):
    """An exchange under way."""

    def Test(self) -> bool: ...


class RankEnded(FcsimError, RuntimeError):
    """Another rank has ended, and this one cannot go on without it; the message says why."""


class Drifted(FcsimError, RuntimeError):
    """Ranks that should do the same do not: what they have computed is not the same."""


class RankFailed(RuntimeError):
    """An error of this rank alone amid exchanges that do not ask for errors first: the others cannot take part in what would follow."""


class World:
    """The ranks, and this one among them: `number` of `size`. common: memory of theirs, None where they are on several machines. exchanges,
    messages and bytes count what this rank has sent, as if each exchange were sent to all others directly (a broadcast: by its root)."""

    def __init__(self) -> None:
        MPI = runtime.mpi()
        self._mpi = MPI
        self._data, self._control = MPI.COMM_WORLD.Dup(), MPI.COMM_WORLD.Dup()
        self.number, self.size = int(self._data.Get_rank()), int(self._data.Get_size())
        self._libraries: object = None
        self.exchanges = self.messages = self.bytes = 0
        self._ended: dict[int, tuple[int, str, bool]] = {}
        self._stopped: dict[int, float] = {}
        self._neighbours, self._looked = on_this_machine(self._control.allgather(this_process())), 0.0
        self.common = CommonMemory(self.number, self.size, self._met) if len(self._neighbours) == self.size - 1 else None
        self.broken = False

    def _wait(self, request: _Request) -> None:
        try:
            self._arrived(request)
        except BaseException:  # an interrupt too: the others' part of this exchange is under way
            self.broken = True
            raise

    def _arrived(self, request: _Request) -> None:
        begin, since = time.perf_counter(), 0.0
        while not request.Test():
            waited = time.perf_counter() - begin
            if waited > AWAKE:
                time.sleep(BRIEF if waited < SOON else NAP)
                self._hear()
                since = since or (waited if self._ended else 0.0)
                if since and waited > since + GRACE:
                    self._left_alone()

    def _hear(self) -> None:
        """Note who has ended."""
        status = self._mpi.Status()
        while self._control.Iprobe(self._mpi.ANY_SOURCE, _ENDED, status):
            self._ended[status.Get_source()] = self._control.recv(source=status.Get_source(), tag=_ENDED)
        if time.perf_counter() > self._looked + LOOK:  # who ends in any other way than a kill has said so above, and waits for all
            self._looked = time.perf_counter()
            for rank in gone(self._neighbours, self._neighbours.keys() - self._ended.keys()):
                self._ended[rank] = (1, "its process was killed, or crashed", False)
            self._name_the_stopped()

    def _name_the_stopped(self) -> None:
        """Say once which ranks are held up, on the first rank of this machine that is not."""
        now = time.perf_counter()
        self._stopped = {
            rank: self._stopped.get(rank, now) for rank in stopped(self._neighbours, self._neighbours.keys() - self._ended.keys())
        }
        speaks = self.number == min({self.number, *self._neighbours} - self._stopped.keys())
        for rank, since in self._stopped.items():
            if speaks and now > since + HELD:
                self._stopped[rank] = float("inf")
                with suppress(OSError, AttributeError):  # nobody reads it
                    text = f"rank {rank} of {self.size} is stopped (by SIGSTOP, or a debugger), and the others wait for it: process"
                    print(f"fcsim: {text} {self._neighbours[rank][1]}", file=sys.stderr, flush=True)

    def _left_alone(self) -> None:
        number = min(self._ended)
        code, why, _ = self._ended[number]
        if why.startswith("interrupted by "):
            raise Ended(why.removeprefix("interrupted by "))
        raise RankEnded(f"rank {number} of {self.size} has ended{f': {why}' if why else f' with exit code {code}'}")

    def _count(self, sent: int, receivers: int) -> None:
        self.exchanges += 1
        self.messages += receivers
        self.bytes += sent * receivers

    def _agree(self, what: str, error: BaseException | None = None) -> None:
        """Raise on every rank what one has raised, of several the lowest body's or rank's; Drifted where ranks are at other places."""
        text = b"" if error is None else _pickled(error)
        mine = np.array([zlib.crc32(what.encode()), len(text)], dtype=np.int64)
        all_ranks = np.empty((self.size, 2), dtype=np.int64)
        self._wait(self._data.Iallgather(mine, all_ranks))
        self._count(mine.nbytes, self.size - 1)
        if not text and all_ranks.tobytes() == mine.tobytes() * self.size:  # thirty times a step
            return
        if all_ranks[:, 1].any():
            texts = self._gathered(np.frombuffer(text, dtype=np.uint8), all_ranks[:, 1])
            bounds = np.concatenate([[0], np.cumsum(all_ranks[:, 1])])
            errors = [(k, pickle.loads(texts[bounds[k] : bounds[k + 1]])) for k in np.flatnonzero(all_ranks[:, 1]).tolist()]
            number, first = min(errors, key=lambda found: (getattr(found[1], "body", -1), found[0]))
            if number == self.number and error is not None:
                raise error
            first.add_note(f"on rank {number} of {self.size}")
            raise first
        if np.any(all_ranks[:, 0] != mine[0]):
            self.broken = True
            raise Drifted(
                f"rank {self.number} of {self.size} came to {what!r} where others did not: ranks must compute the same. They do not where "
                "a case's script depends on the process (its time, its number, random numbers without a seed), or on other processors"
            )

    @contextmanager
    def together(self, what: str) -> Iterator[None]:
        """A block in which ranks do work of their own: an error of one is every rank's at its end, or at the next exchange inside."""
        error: Exception | None = None
        try:
            yield
        except Exception as raised:  # of any class: the others wait for what is agreed
            error = raised
        self._agree(what, error)

    @contextmanager
    def collective(self, what: str) -> Iterator[object]:
        """A block in which all ranks call a library that exchanges by itself, as PETSc and MUMPS do, with the communicator that is theirs.

        Nobody enters before all have come, and signals wait until the block's end. A rank that waits inside does so awake, and does not
        hear others that end: whoever leaves the block by an error that the others do not have ends them after `LAST_WAIT`.
        """
        self._agree(what)
        if self._libraries is None:
            self._libraries = self._data.Dup()
        with held_back():
            try:
                yield self._libraries
            except FcsimError:  # found by all of them
                raise
            except BaseException:  # an interrupt, too: the others are within the library's exchanges
                self.broken = True
                raise

    @contextmanager
    def unasked(self, what: str) -> Iterator[None]:
        """A block whose exchanges do not ask for errors first (`gathered`): an error in it is this rank's alone, and RankFailed, so that
        nobody takes it for one that all ranks have and goes on: the others are in the midst of other exchanges."""
        try:
            yield
        except (RankEnded, Drifted):
            raise
        except Exception as error:  # of any class, see above
            self.broken = True
            raise RankFailed(f"{what}: {type(error).__name__}: {error}") from error

    def _gathered(self, own: NDArray, counts: IntArray | list[int]) -> NDArray:
        counts = counts if isinstance(counts, list) else counts.tolist()
        everything = np.empty(sum(counts), dtype=own.dtype)
        self._wait(self._data.Iallgatherv(np.ascontiguousarray(own), [everything, counts]))
        self._count(own.nbytes, self.size - 1)
        return everything

    def gathered[T: np.generic](self, own: NDArray[T], counts: IntArray | list[int]) -> NDArray[T]:
        """The numbers (sum of counts,) of all ranks in their order, counts (size,); own (counts[number],): this rank's."""
        return self._gathered(own, counts)

    def exchanged[T: np.generic](self, own: NDArray[T], lengths: IntArray) -> NDArray[T]:
        """What the ranks send to this one, one after the other, lengths (size, size) numbers from each to each; own: what it sends to each,
        likewise."""
        given, taken = lengths[self.number].tolist(), lengths[:, self.number].tolist()
        received = np.empty(sum(taken), dtype=own.dtype)
        self._wait(self._data.Ialltoallv([own, given], [received, taken]))
        self._count(own.nbytes, int(np.count_nonzero(given)))
        return received

    def complete(self, values: NDArray, counts: list[int]) -> None:
        """Have values (sum of counts, ...), of which this rank has written its own part, the others' parts too; counts: of rows."""
        size = values.size // max(1, len(values))
        self._wait(self._data.Iallgatherv(self._mpi.IN_PLACE, [values, [size * count for count in counts]]))
        self._count(size * counts[self.number] * values.itemsize, self.size - 1)

    def _met(self, own: IntArray) -> IntArray:
        """Numbers (size, k) of all ranks, own (k,)."""
        every = np.empty((self.size, len(own)), dtype=np.int64)
        self._wait(self._data.Iallgather(own, every))
        self._count(own.nbytes, self.size - 1)
        return every

    def summed(self, what: str, values: FloatArray) -> None:
        """Replace values by their sum over the ranks: the same bits on each."""
        self._agree(what)
        for begin in range(0, len(values), SUMMED_AT_ONCE):  # MPI has copies of what it sums
            some = values[begin : begin + SUMMED_AT_ONCE]
            own, whole = (self._mpi.IN_PLACE, some) if self.number == 0 else (some, None)
            self._wait(self._data.Ireduce(own, whole, root=0))
            self._count(some.nbytes, int(self.number > 0))
            self._broadcast(some, 0)

    def _broadcast(self, values: NDArray, root: int) -> None:
        self._wait(self._data.Ibcast(values, root=root))
        self._count(values.nbytes, (self.size - 1) * int(self.number == root))

    def broadcast(self, values: FloatArray, root: int) -> FloatArray:
        """The array of the rank `root`, given to all others in `values` of the same shape."""
        self._broadcast(values, root)
        return values

    def told[T](self, what: str, value: T | None) -> T:
        """The value that rank 0 has."""
        text = np.frombuffer(pickle.dumps(value) if self.number == 0 else b"", dtype=np.uint8)
        self._agree(what)
        length = np.array([len(text)])
        self._broadcast(length, 0)
        text = text.copy() if self.number == 0 else np.empty(int(length[0]), dtype=np.uint8)
        self._broadcast(text, 0)
        found: T = pickle.loads(text.tobytes())
        return found

    def same(self, what: str, parts: Sequence[bytes | NDArray]) -> None:
        """Drifted where these bytes are not the same on every rank."""
        digest = hashlib.sha256()
        for part in parts:
            digest.update(part if isinstance(part, bytes) else lanes(part))
        mine = np.frombuffer(digest.digest(), dtype=np.int64)
        all_ranks = np.empty((self.size, 4), dtype=np.int64)
        self._agree(what)
        self._wait(self._data.Iallgather(mine, all_ranks))
        self._count(mine.nbytes, self.size - 1)
        if np.any(all_ranks != all_ranks[0]):
            other = int(np.argmax(np.any(all_ranks != all_ranks[0], axis=1)))
            raise Drifted(
                f"{what}: expected the same on every rank, rank {other} of {self.size} has another than rank 0. Ranks must compute the "
                "same: a case's script must not depend on the process (random numbers without a seed, the order of a set, the time), and "
                "processors, packages and files must be alike"
            )

    def work(self) -> IntArray:
        """Exchanges, messages and bytes (size, 3) that each rank has sent so far."""
        mine = np.array([self.exchanges, self.messages, self.bytes], dtype=np.int64)
        all_ranks = np.empty((self.size, 3), dtype=np.int64)
        self._agree("work")
        self._wait(self._data.Iallgather(mine, all_ranks))
        return all_ranks

    def leave(self, code: int, why: str, *, regular: bool) -> None:
        """Say that this rank has ended, and wait for all others to end: as long as it takes where this one ended regularly, else up to
        `LAST_WAIT`; then end them. `broken` says afterwards whether some rank left an exchange, so that MPI cannot be left in order."""
        for other in range(self.size):
            if other != self.number:
                self._control.isend((code, why, not self.broken), dest=other, tag=_ENDED)
        begin = time.perf_counter()
        while len(self._ended) < self.size - 1:
            if not regular and time.perf_counter() - begin > LAST_WAIT:
                self._mpi.COMM_WORLD.Abort(code or 1)
            time.sleep(NAP)
            self._hear()
        self.broken |= not all(well for _, _, well in self._ended.values())
        if not self.broken:  # a rank that has gone could take with it what it has sent
            request = self._control.Ibarrier()
            while not request.Test():
                time.sleep(NAP)
        elif self.number:
            time.sleep(LAST_WORD)


def _pickled(error: BaseException) -> bytes:
    """The error as others can raise it: itself, or what it says."""
    try:
        text = pickle.dumps(error)
        pickle.loads(text)
    except Exception:  # an error of any class, with arguments of any kind
        text = pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return text
