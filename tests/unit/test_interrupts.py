"""Signals that end a command are heard wherever they come."""

from __future__ import annotations

import gc
import signal
import sys
import time
from collections.abc import Callable
from weakref import WeakKeyDictionary

import pytest

from fcsim.interrupts import Ended, ended_politely


class _Loud(dict[object, object]):
    """Of which an entry is forgotten as Ctrl-C comes."""

    def __delitem__(self, key: object) -> None:
        signal.raise_signal(signal.SIGINT)
        super().__delitem__(key)


class _Key:
    pass


class _Last:
    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


def _in_a_weak_dictionary() -> None:
    known: WeakKeyDictionary[_Key, int] = WeakKeyDictionary()
    key = _Key()
    known[key] = 1
    known.data = _Loud(known.data)  # type: ignore[attr-defined]
    del key


def _in_a_last_act() -> None:
    last = _Last()
    del last


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("when", [_in_a_weak_dictionary, _in_a_last_act])
def test_ctrl_c_is_heard_where_python_forgets_what_is_raised(when: Callable[[], None]) -> None:
    """Callbacks of weak references and `__del__`: Python prints what they raise and goes on, so that a run went on."""
    with ended_politely(), pytest.raises(Ended, match="the keyboard"):
        when()
        time.sleep(5)


class _Value:
    """As LLVM's in Python: what `__del__` gives back is what `__init__` got."""

    def __init__(self, takes: Callable[[], None]) -> None:
        takes()
        self.handle = 1

    def __del__(self) -> None:
        assert self.handle


def _interrupted() -> None:
    signal.raise_signal(signal.SIGINT)


def _refused() -> None:
    raise ValueError("no room")


def test_what_an_interrupt_left_half_made_goes_without_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while a kernel was compiled could print a traceback: 'ValueRef' object has no attribute '_as_parameter_'."""
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda dropped: told.append(dropped.exc_type))
    with ended_politely():
        with pytest.raises(ValueError, match="no room"):
            _Value(_refused)
        gc.collect()
        assert told == [AttributeError], "without an interrupt it is told as ever"
        with pytest.raises(Ended):
            _Value(_interrupted)
        gc.collect()
    assert told == [AttributeError]
    with pytest.raises(ValueError, match="no room"):
        _Value(_refused)
    gc.collect()
    assert told == [AttributeError, AttributeError], "nor afterwards"
