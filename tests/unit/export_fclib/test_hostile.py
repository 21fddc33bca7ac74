"""FCLIB files that lead elsewhere or unpack to far more than they hold."""

import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.problem import LocalProblem

FAULTS = Path(__file__).parents[2] / "faults" / "data"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_fclib(
        tmp_path / "a.hdf5", LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3])), title="\x1b]0;retitled\x07 \x1b[2J"
    )


def test_data_stored_in_another_file() -> None:
    with pytest.raises(InputError, match="expected the problem within this file, got data stored in others"):
        read_fclib(FAULTS / "external-etc-passwd.hdf5")


def test_links_to_another_file(file: Path, tmp_path: Path) -> None:
    other = write_fclib(tmp_path / "b.hdf5", LocalProblem(np.eye(3), np.array([-2.0, 0, 0]), np.array([0.3])))
    for name in ("fclib_local/vectors", "fclib_local/vectors/q", "fclib_local"):
        with h5py.File(file, "r+") as content:
            del content[name]
            content[name] = h5py.ExternalLink(other.name, "/" + name)
        with pytest.raises(InputError, match="expected the problem within this file, got a link to another"):
            read_fclib(file)


def test_a_soft_link_is_named_as_such(file: Path) -> None:
    with h5py.File(file, "r+") as content:
        content.move("fclib_local/vectors/q", "elsewhere")
        content["fclib_local/vectors/q"] = h5py.SoftLink("/elsewhere")
    with pytest.raises(InputError, match=r"/fclib_local/vectors/q: expected the problem within this file, got a soft link"):
        read_fclib(file)


def test_a_virtual_dataset(file: Path, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "b.h5", "w") as other:
        other["q"] = np.zeros(3)
    with h5py.File(file, "r+") as content:
        del content["fclib_local/vectors/q"]
        layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "b.h5"), "q", shape=(3,))
        content.create_virtual_dataset("fclib_local/vectors/q", layout)
    with pytest.raises(InputError, match="got data stored in others"):
        read_fclib(file)


def test_what_the_problem_does_not_need_is_not_unpacked() -> None:
    """19 kB that hold 2.5 GB behind the matrix's entries: the entries alone are read."""
    tracemalloc.start()
    problem = read_fclib(FAULTS / "bomb-long-x.hdf5").problem
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert problem.m == 9 and peak < 50e6


@pytest.mark.parametrize("name", ["q", "mu"])
def test_a_vector_that_unpacks_to_far_more(file: Path, name: str) -> None:
    with h5py.File(file, "r+") as content:
        del content[f"fclib_local/vectors/{name}"]
        content["fclib_local/vectors"].create_dataset(name, (3 * 10**9,), dtype="f8", chunks=(10**6,), compression="gzip")
    with pytest.raises(InputError, match=f"vectors/{name}: expected data, got 0 bytes that unpack to 3000000000 entries"):
        read_fclib(file)


def test_titles_do_not_reach_the_terminal(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from fcsim.command_line.main import main

    assert main(["info", str(file)]) == 0
    printed = capsys.readouterr().out
    assert "retitled" in printed and "\x1b" not in printed and "\x07" not in printed
