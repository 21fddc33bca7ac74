"""Files are there whole or not at all."""

import os
import resource
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fcsim.assembly.time_functions import read_acceleration_record, read_table
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.files import inside, refuse_unwritable, regular, replacing, replacing_hdf5, resolved
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.io import read_mesh, read_parts, write_mesh
from fcsim.mesh.material import Material
from fcsim.problem import LocalProblem


@pytest.fixture
def no_file_above_100_kb() -> Iterator[None]:
    """What a full disk does, to this process only."""
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("failure", [ZeroDivisionError, KeyboardInterrupt])
def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path: Path, failure: type[BaseException]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(failure), replacing(path) as temporary:
        temporary.write_text("half")
        raise failure
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_no_file_takes_the_place_of_a_pipe_or_a_device(tmp_path: Path) -> None:
    """As root `--write-solution /dev/null` made a file of the machine's null device."""
    pipe, output, device = tmp_path / "pipe", tmp_path / "output", tmp_path / "device"
    os.mkfifo(pipe)
    output.symlink_to("/proc/self/fd/1")  # as /dev/stdout is
    device.symlink_to(os.devnull)
    for path in (pipe, output, device):
        before = os.lstat(path)
        with pytest.raises(InputError, match="expected the name of a file to write, found a pipe or a device"):
            refuse_unwritable(path)
        with pytest.raises(InputError, match="found a pipe or a device"), replacing(path) as temporary:
            temporary.write_text("new")
        assert os.lstat(path) == before


def test_hdf5_files_too(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    for value in (1.0, 2.0):
        with replacing_hdf5(path) as file:
            file["x"] = np.full(5, value)
        with h5py.File(path) as file:
            assert file["x"][()].tolist() == [value] * 5
    with pytest.raises(ZeroDivisionError), replacing_hdf5(path) as file:
        file["x"] = np.zeros(5)
        raise ZeroDivisionError
    with h5py.File(path) as file:
        assert file["x"][0] == 2
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_an_error_that_names_the_file(tmp_path: Path, no_file_above_100_kb: None) -> None:
    path = tmp_path / "a.h5"
    with replacing_hdf5(path) as file:
        file["x"] = np.zeros(5)
    with pytest.raises(OSError, match=r"File too large: .*a\.h5'"), replacing_hdf5(path) as file:
        file["x"] = np.zeros(50_000)
    with h5py.File(path) as file:
        assert len(file["x"]) == 5
    with pytest.raises(OSError, match=r"File too large: .*b\.txt'"), replacing(tmp_path / "b.txt") as temporary:
        temporary.write_bytes(bytes(200_000))
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("call", [lambda path: inside(path.parent, path), resolved], ids=["inside", "resolved"])
def test_links_in_a_circle(tmp_path: Path, call: Callable[[Path], Path]) -> None:
    """Python's RuntimeError reached the user as a traceback."""
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(InputError, match=r"/a: expected a file or folder, found links in a circle"):
        call(tmp_path / "a")


def test_pipes_and_devices_are_not_read(tmp_path: Path) -> None:
    """A pipe without a writer hangs, /dev/zero has no end."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(InputError, match="expected a file, got a pipe or a device"):
            regular(path)
    assert regular(tmp_path) == tmp_path and regular(tmp_path / "none") == tmp_path / "none"


def test_what_went_wrong_first_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is read-only by now lets the temporary file stay, too."""
    path = tmp_path / "a.txt"
    with pytest.raises(OSError, match="No space") as told, replacing(path) as temporary:

        def read_only(*_: object, **__: object) -> None:
            raise OSError(30, "Read-only file system", str(temporary))

        monkeypatch.setattr(Path, "unlink", read_only)
        raise OSError(28, "No space left on device", str(temporary))
    assert told.value.filename == str(path)


@pytest.mark.parametrize("given", [3, b"one.hdf5", None])
def test_what_is_no_path_is_refused_by_its_argument(given: object) -> None:
    """Not by Python's TypeError; and a number would be an open file's."""
    problem = LocalProblem(np.eye(3), np.zeros(3), np.array([0.5]))
    part, stone = rectangle("part", (1, 1), (1, 1), Material(1e6, 0.3, 1000.0)), Material(1e6, 0.3, 1000.0)
    calls: list[Callable[[Any], object]] = [
        read_fclib,
        lambda path: write_fclib(path, problem),
        lambda path: read_mesh(path, stone),
        lambda path: read_parts(path, {"part": stone}),
        lambda path: write_mesh(part, path),
        lambda path: read_table(path, "a"),
        read_acceleration_record,
    ]
    for call in calls:
        with pytest.raises(InputError, match=r"^path: expected the path of an? .* file.*, got "):
            call(given)
