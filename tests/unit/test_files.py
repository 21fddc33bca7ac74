"""Files are there whole or not at all."""

import resource
import signal
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.files import replacing, replacing_hdf5


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
