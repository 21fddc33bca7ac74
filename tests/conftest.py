"""Before any test imports NumPy: fcsim limits the threads of BLAS, which fight with those of other processes. Nothing has a deadline.

Where numba's cache is empty, two workers do not compile the same twice: they begin in different rooms, and where they meet all the same,
the second waits for what the first puts into the cache.
"""

from __future__ import annotations

import gc
import signal
from collections import Counter, defaultdict
from collections.abc import Generator, Hashable, Mapping, Sequence
from typing import Any

import hypothesis
import pytest

import fcsim  # noqa: F401
from tests.compiling import LOCKS, compile_once

hypothesis.settings.register_profile("no clock", deadline=None)  # what is compiled first would be late
hypothesis.settings.load_profile("no clock")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a background shell's jobs, and theirs, would never hear Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)

SOLVING = ("tests/conformance/", *(f"tests/unit/{room}/" for room in ("bench", "collection", "linear", "problem", "solvers")))
"""What compiles the kernels of solvers; all else begins with those of bodies and contacts."""

RANKS = "tests/unit/ranks/"
"""Whose files go to one worker: they share what ranks do, see `TOGETHER` there."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected, 13 000 tests and the modules they are in, lives to the end: Python's collector of cycles need not walk through
    it again and again, half a second each time."""
    gc.disable()
    try:
        return (yield)
    finally:
        keep_what_lives()
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """So do the types and the compiled functions that a file of tests has made: each walk through them took up to a tenth of the time in
    which numba compiled. The oldest objects are looked through where a file ends, and within one only after 2 million new ones."""
    if nextitem is None or nextitem.path != item.path:
        keep_what_lives()


def keep_what_lives() -> None:
    gc.collect()
    gc.freeze()


def covering(cases: Sequence[Mapping[str, Hashable]]) -> set[int]:
    """Numbers of the cases, few, in which each parameter has each of the values that it has in any of them: whichever has the most values
    that none before has, and of those the one whose others are in the fewest."""
    missing = {value for case in cases for value in case.items()}
    chosen: set[int] = set()
    uses: Counter[tuple[str, Hashable]] = Counter()
    while missing:
        best = max(range(len(cases)), key=lambda k: (len(missing & set(cases[k].items())), -sum(uses[value] for value in cases[k].items())))
        chosen.add(best)
        uses.update(cases[best].items())
        missing -= set(cases[best].items())
    return chosen


def values_of(item: pytest.Function) -> dict[str, Hashable]:
    """Which value a test has of each `parametrize`: they are the same objects in all combinations."""
    names: list[Any] = [mark.args[0] for mark in item.iter_markers("parametrize")]
    together = [own.split(",") if isinstance(own, str) else own for own in names]
    return {",".join(own): tuple(id(item.callspec.params[name.strip()]) for name in own) for own in together}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of the tests of a function marked `each_value`, those which are not of a few that have every value are slow."""
    crossed: dict[str, list[pytest.Function]] = defaultdict(list)
    for item in items:
        if isinstance(item, pytest.Function) and item.get_closest_marker("each_value") and not item.get_closest_marker("slow"):
            crossed[f"{item.path}::{item.originalname}"].append(item)
    for own in crossed.values():
        chosen = covering([values_of(item) for item in own])
        for k, item in enumerate(own):
            if k not in chosen:
                item.add_marker(pytest.mark.slow)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Files by their number of tests, as xdist has them, those of `RANKS` together; every second worker takes those of `SOLVING` first, the
    others the rest."""
    from xdist.scheduler import LoadFileScheduling

    if config.getvalue("dist") != "loadfile":
        return None

    class InRooms(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return RANKS if nodeid.startswith(RANKS) else str(super()._split_scope(nodeid))

        def _assign_work_unit(self, node: Any) -> None:
            solving = self.nodes.index(node) % 2 == 1
            own = next((file for file in self.workqueue if file.startswith(SOLVING) == solving), None)
            if own is not None:
                self.workqueue.move_to_end(own, last=False)
            super()._assign_work_unit(node)

    return InRooms(config, log)


def pytest_configure(config: pytest.Config) -> None:
    gc.set_threshold(2000, 10, 100)
    if hasattr(config, "workerinput"):
        compile_once(LOCKS)
