"""checkpoint.h5 by itself: what is written comes back, and nothing else is taken for it."""

import hashlib
from collections.abc import Callable
from dataclasses import astuple, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.contact_law.law import Variables
from fcsim.errors import InputError
from fcsim.running.checkpoint import MEMORIES, content_digest, read_checkpoint, write_checkpoint
from fcsim.timestep.chain import Lead
from fcsim.timestep.energy import Ledger
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.state import State
from fcsim.timestep.step import Moment


def reactions(nc: int, seed: int) -> Reactions:
    rng = np.random.default_rng(seed)
    return Reactions(np.arange(nc) * 3 + seed, rng.standard_normal((nc, 3, 3)), rng.standard_normal((nc, 3)))


def moment(number: int = 17, *, full: bool = True) -> Moment:
    rng = np.random.default_rng(number)
    x, v, rate, inertia = rng.standard_normal((4, 9))
    if not full:
        return Moment(number, State(0.25, x, v))
    law = Variables(np.array([2, 5, 9]), {"opening": rng.standard_normal(3), "slip": rng.standard_normal((3, 2))}, 1.25)
    return Moment(
        number,
        State(0.017, x, v, rate, inertia),
        (reactions(4, 1), reactions(3, 2), reactions(0, 3)),
        2,
        law,
        Ledger(1.5, -0.25, -0.5, 0.125, True),
        Lead("NSN-AC", 3, 40),
        1e-3,
    )


def written(path: Path, now: Moment, anchor: Moment) -> Path:
    step: Any = SimpleNamespace(moment=now, anchor=anchor)
    write_checkpoint(path, step)
    return path


def assert_same(found: Moment, given: Moment) -> None:
    assert (found.number, found.cuts, found.seen, found.state.t) == (given.number, given.cuts, given.seen, given.state.t)
    assert astuple(found.ledger) == astuple(given.ledger) and type(found.ledger.begun) is bool
    assert astuple(found.lead) == astuple(given.lead)
    for field in fields(State):
        a, b = getattr(found.state, field.name), getattr(given.state, field.name)
        assert (a is None) == (b is None)
        if b is not None:
            assert_array_equal(a, b)
    assert len(found.memory) == len(given.memory)
    for mine, theirs in zip(found.memory, given.memory, strict=True):
        for name in ("identity", "frame", "r"):
            assert_array_equal(getattr(mine, name), getattr(theirs, name))
    assert (found.variables is None) == (given.variables is None)
    if given.variables is not None and found.variables is not None:
        assert found.variables.stored == given.variables.stored
        assert_array_equal(found.variables.identity, given.variables.identity)
        assert found.variables.values.keys() == given.variables.values.keys()
        for name, values in given.variables.values.items():
            assert_array_equal(found.variables.values[name], values)


@pytest.mark.parametrize("full", [True, False])
def test_what_is_written_comes_back(tmp_path: Path, full: bool) -> None:
    now, anchor = moment(17, full=full), moment(3, full=not full)
    found = read_checkpoint(written(tmp_path / "checkpoint.h5", now, anchor))
    assert found is not None
    assert_same(found[0], now)
    assert_same(found[1], anchor)


def test_there_may_be_none(tmp_path: Path) -> None:
    assert read_checkpoint(tmp_path / "checkpoint.h5") is None
    assert read_checkpoint(tmp_path) is None


def test_as_many_memories_as_any_run_keeps(tmp_path: Path) -> None:
    many = Moment(1, State(0.0, np.zeros(3), np.zeros(3)), tuple(reactions(1, k) for k in range(MEMORIES)))
    found = read_checkpoint(written(tmp_path / "c.h5", many, moment(0, full=False)))
    assert found is not None and len(found[0].memory) == MEMORIES == 100
    assert_same(found[0], many)
    more = Moment(1, State(0.0, np.zeros(3), np.zeros(3)), tuple(reactions(1, k) for k in range(MEMORIES + 1)))
    with pytest.raises(InputError, match=r"c\.h5: expected a checkpoint of an earlier run: 101 reactions of earlier steps"):
        read_checkpoint(written(tmp_path / "c.h5", more, moment(0, full=False)))


def test_the_digest_is_of_names_types_shapes_and_values(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["b"], file.attrs["a"], file.attrs["sha256"] = 2, 1, "left out"
        file["g/x"] = np.arange(6.0).reshape(2, 3)
        file["g"].attrs["c"] = "text"
        one, two = (np.int64(k).tobytes() for k in (1, 2))
        parts = (b'["", "a", "<i8", []]', one, b'["", "b", "<i8", []]', two, b'["g", "c", "text", "text"]', b'["g/x", "<f8", [2, 3]]')
        assert content_digest(file) == hashlib.sha256(b"".join(parts) + np.arange(6.0).tobytes()).hexdigest()


@pytest.mark.parametrize("printed", [{"precision": 2}, {"legacy": "1.13"}, {"threshold": 0, "edgeitems": 1}], ids=str)
def test_the_digest_is_not_of_what_is_printed(tmp_path: Path, printed: dict[str, Any]) -> None:
    """A case script may set how NumPy prints; `repr` of an array has eight digits, and three dots beyond a thousand entries."""
    path = written(tmp_path / "c.h5", moment(), moment(3))
    with np.printoptions(**printed):
        found = read_checkpoint(path)
        assert found is not None
        written(tmp_path / "d.h5", *found)
    again = read_checkpoint(tmp_path / "d.h5")
    assert again is not None
    assert_same(again[0], moment())


def next_after(file: h5py.File, place: str, k: int) -> None:
    values = file.attrs[place]
    values[k] = np.nextafter(values[k], 7.0)
    file.attrs[place] = values


@pytest.mark.parametrize("k", range(4))
def test_the_last_digit_of_the_ledger_is_seen(tmp_path: Path, k: int) -> None:
    path = written(tmp_path / "c.h5", moment(), moment(3))
    with h5py.File(path, "r+") as file:
        next_after(file, "ledger", k)
    with pytest.raises(InputError, match="its checksum does not agree"):
        read_checkpoint(path)


def test_one_entry_of_many_in_an_attribute_is_seen(tmp_path: Path) -> None:
    digests = set()
    for k in range(2):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file.attrs["many"] = np.arange(2000) + k * (np.arange(2000) == 1000)
            digests.add(content_digest(file))
    assert len(digests) == 2


def test_a_checkpoint_says_which_run_it_is_of(tmp_path: Path) -> None:
    step: Any = SimpleNamespace(moment=moment(), anchor=moment(3))
    write_checkpoint(tmp_path / "c.h5", step, "ab12")
    assert read_checkpoint(tmp_path / "c.h5", "ab12") is not None and read_checkpoint(tmp_path / "c.h5") is not None
    for other in ("", "ab13"):
        with pytest.raises(InputError, match=r"c\.h5: expected a checkpoint of the run that run\.json describes, got one of another run"):
            read_checkpoint(tmp_path / "c.h5", other)


def test_texts_in_an_array_are_none_of_a_checkpoint(tmp_path: Path) -> None:
    path = written(tmp_path / "c.h5", moment(), moment(3))
    with h5py.File(path, "r+") as file:
        file["texts"] = np.array(["a", "b"], dtype=h5py.string_dtype())
    with pytest.raises(InputError, match="expected a checkpoint of an earlier run: texts: expected numbers or a text"):
        read_checkpoint(path)


CHANGES: dict[str, Callable[[h5py.File], Any]] = {
    "a value": lambda f: f["x"].__setitem__(2, f["x"][2] + 1e-15),
    "a value of the anchor": lambda f: f["anchor/v"].__setitem__(0, 7.0),
    "a memory": lambda f: f["memory/1/r"].__setitem__((0, 0), 3.0),
    "an attribute": lambda f: f.attrs.__setitem__("step", 18),
    "the ledger": lambda f: f.attrs.__setitem__("ledger", np.zeros(5)),
    "the digest": lambda f: f.attrs.__setitem__("sha256", "0" * 64),
    "no digest": lambda f: f.attrs.__delitem__("sha256"),
    "an array more": lambda f: f.__setitem__("y", np.zeros(2)),
    "an array less": lambda f: f.__delitem__("rate"),
    "the origin": lambda f: f.attrs.__setitem__("origin", "another"),
    "an attribute less": lambda f: f.attrs.__delitem__("seen"),
}


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_every_change_is_seen(tmp_path: Path, change: str) -> None:
    path = written(tmp_path / "checkpoint.h5", moment(), moment(3))
    with h5py.File(path, "r+") as file:
        CHANGES[change](file)
    with pytest.raises(InputError, match=r"checkpoint\.h5: expected the checkpoint as it was written; its checksum does not agree"):
        read_checkpoint(path)


def sealed(path: Path, change: Callable[[h5py.File], Any]) -> Path:
    """A change by someone who knows how the checksum is made."""
    with h5py.File(path, "r+") as file:
        change(file)
        if "sha256" in file.attrs:
            file.attrs["sha256"] = content_digest(file)
    return path


def replaced(file: h5py.File, name: str, values: Any) -> None:
    del file[name]
    file[name] = values


def circle(file: h5py.File) -> None:
    file["memory/again"] = file["memory"]


def packed(file: h5py.File) -> None:
    del file["x"]
    file.create_dataset("x", data=np.zeros(9), chunks=(3,), compression="gzip")


def outside(file: h5py.File) -> None:
    del file["x"]
    file.create_dataset("x", (9,), dtype="f8", external=[("elsewhere", 0, 72)])


def virtual(file: h5py.File) -> None:
    del file["x"]
    layout = h5py.VirtualLayout((9,), "f8")
    layout[:] = h5py.VirtualSource("elsewhere.h5", "x", (9,))
    file.create_virtual_dataset("x", layout)


FORGED: list[tuple[str, Callable[[h5py.File], Any], str]] = [
    ("of single precision", lambda f: replaced(f, "x", np.zeros(9, dtype=np.float32)), "/x: expected float64 of 1 axes"),
    ("of two axes", lambda f: replaced(f, "x", np.zeros((3, 3))), r"/x: expected float64 of 1 axes, got float64 of shape \(3, 3\)"),
    ("r of one axis", lambda f: replaced(f, "memory/0/r", np.zeros(12)), "expected float64 of 2 axes"),
    ("r of another dimension", lambda f: replaced(f, "memory/0/r", np.zeros((4, 2))), "do not fit"),
    ("frames of fewer contacts", lambda f: replaced(f, "memory/0/frame", np.zeros((3, 3, 3))), "do not fit"),
    ("a frame of two axes", lambda f: replaced(f, "memory/0/frame", np.zeros((3, 3))), "expected float64 of 3 axes"),
    ("identities that are no numbers", lambda f: replaced(f, "memory/0/identity", np.zeros(4)), "do not fit"),
    ("fewer identities", lambda f: replaced(f, "memory/0/identity", np.arange(3)), "do not fit"),
    ("variables of fewer contacts", lambda f: replaced(f, "law/values/opening", np.zeros(2)), "expected variables of 3 contacts"),
    ("variables of more contacts", lambda f: replaced(f, "law/values/opening", np.zeros(4)), "expected variables of 3 contacts"),
    ("variables of another type", lambda f: replaced(f, "law/values/opening", np.zeros(3, "f4")), "expected variables of 3 contacts"),
    ("identities of two axes", lambda f: replaced(f, "law/identity", np.zeros((3, 1), int)), "expected variables of 3 contacts"),
    ("no state", lambda f: f.__delitem__("v"), "earlier run"),
    ("no anchor", lambda f: f.__delitem__("anchor"), "earlier run"),
    ("no memory", lambda f: f.__delitem__("memory"), "earlier run"),
    ("an age that is missing", lambda f: f["memory"].move("1", "7"), "earlier run"),
    ("no time", lambda f: f.attrs.__delitem__("t"), "earlier run"),
    ("a short ledger", lambda f: f.attrs.__setitem__("ledger", np.zeros(4)), "earlier run"),
    ("a short lead", lambda f: f.attrs.__setitem__("lead_counts", np.zeros(1, int)), "earlier run"),
    ("a text for a number", lambda f: f.attrs.__setitem__("step", "many"), "earlier run"),
    ("compressed", packed, "x is not stored as a checkpoint's arrays are"),
    ("stored elsewhere", outside, "x is not stored as"),
    ("of another file", virtual, "x is not stored as"),
    ("a link within", lambda f: f.__setitem__("soft", h5py.SoftLink("/x")), "soft is a link"),
    ("a link without", lambda f: f.__setitem__("anchor/out", h5py.ExternalLink("a.h5", "/x")), "out is a link"),
    ("a circle", circle, "groups in a circle"),
    ("more groups than it has", lambda f: [f.create_group(f"group {k}") for k in range(3 * MEMORIES)], "groups in a circle"),
]


@pytest.mark.parametrize(("change", "said"), [row[1:] for row in FORGED], ids=[row[0] for row in FORGED])
def test_what_cannot_be_a_checkpoint(tmp_path: Path, change: Callable[[h5py.File], Any], said: str) -> None:
    path = written(tmp_path / "checkpoint.h5", moment(), moment(3))
    if change not in (circle, outside, virtual):
        sealed(path, change)
    else:
        with h5py.File(path, "r+") as file:
            change(file)
    with pytest.raises(InputError, match=r"checkpoint\.h5: expected a checkpoint of an earlier run: .*" * (said != "earlier run") + said):
        read_checkpoint(path)


def test_as_many_reactions_as_a_run_keeps_and_no_more(tmp_path: Path) -> None:
    states, few = moment(5, full=False), tuple(reactions(1, age) for age in range(MEMORIES + 1))
    full = replace(states, memory=few[:MEMORIES])
    found = read_checkpoint(written(tmp_path / "full.h5", full, full))
    assert found is not None
    assert_same(found[0], full)
    assert_same(found[1], full)
    path = written(tmp_path / "more.h5", replace(states, memory=few), states)
    with pytest.raises(InputError, match="101 reactions of earlier steps"):
        read_checkpoint(path)


def test_variables_without_values(tmp_path: Path) -> None:
    bare = Moment(1, State(0.0, np.zeros(3), np.zeros(3)), variables=Variables(np.array([4]), {}))
    found = read_checkpoint(written(tmp_path / "c.h5", bare, bare))
    assert found is not None and found[0].variables is not None and dict(found[0].variables.values) == {}


@pytest.mark.parametrize("content", [b"", b"x" * 100, b"\x89HDF\r\n\x1a\n" + b"\0" * 200])
def test_what_is_no_hdf5_file(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "c.h5").write_bytes(content)
    with pytest.raises(InputError, match=r"c\.h5: expected a checkpoint of an earlier run"):
        read_checkpoint(tmp_path / "c.h5")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda file: replaced(file, "law/values/opening", np.ones(3, dtype=np.complex128)), "expected variables of 3 contacts"),
        (lambda file: replaced(file, "memory/0/frame", np.zeros((5, 3, 3))), r"frame \(5, 3, 3\) and r \(4, 3\) do not fit"),
    ],
    ids=["a wider type", "more frames than reactions"],
)
def test_wider_and_longer_arrays_do_not_fit(tmp_path: Path, change: Callable[[h5py.File], Any], said: str) -> None:
    path = sealed(written(tmp_path / "checkpoint.h5", moment(), moment(3)), change)
    with pytest.raises(InputError, match=said):
        read_checkpoint(path)
