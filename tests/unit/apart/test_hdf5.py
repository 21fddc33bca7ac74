"""HDF5 files read in another process: the same values as h5py gives, and whatever a file does to its reader is one error here."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.apart import Array, Group, Link, hdf5_process, opened_apart
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.problem import LocalProblem

VALUES = {
    "doubles": np.linspace(0, 1, 7),
    "matrix": np.arange(12.0).reshape(3, 4),
    "big endian": np.arange(5, dtype=">f4"),
    "small integers": np.arange(5, dtype=np.uint8),
    "a number": np.float64(np.nan),
    "switches": np.array([True, False]),
    "nothing": np.zeros((0, 3)),
    "fixed text": np.array([b"ab", b"c"]),
    "text": "grüß\udcff".encode("utf-8", "surrogateescape"),
    "group/deep/er": np.arange(3),
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    with h5py.File(tmp_path / "a.h5", "w") as content:
        for name, values in VALUES.items():
            content[name] = values
        content.attrs["t"], content.attrs["who"], content.attrs["many"] = 0.1, "us", np.arange(3)
        content.create_dataset("packed", data=np.zeros(10**6), compression="gzip")
        content.create_dataset("texts", data=["one", "two"])
    return tmp_path / "a.h5"


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Processes begun anew, here and afterwards."""
    hdf5_process._at_the_end()
    yield monkeypatch
    hdf5_process._at_the_end()


def mad(reader: pytest.MonkeyPatch, does: str) -> None:
    """A reader that does something else when it is asked."""
    code = f"import os, signal, fcsim.apart.hdf5_reader as r\ndef read(*a):\n  {does}\nr._read = read; r.main()"
    reader.setattr(hdf5_process, "COMMAND", code)


def test_the_values_are_those_of_h5py(file: Path) -> None:
    found = opened_apart(file)
    for name, values in VALUES.items():
        entry = found[name]
        assert isinstance(entry, Array), name
        expected = np.asarray(values)
        with h5py.File(file) as content:
            stored = content[name][()]
        assert type(entry[()]) is type(stored) and np.asarray(entry[()]).dtype == np.asarray(stored).dtype, name
        np.testing.assert_array_equal(np.asarray(entry[()]), np.asarray(stored))
        assert entry.shape == expected.shape or name == "text"
    assert list(found.array("texts")) == [b"one", b"two"]
    assert found.attrs["t"] == 0.1 and found.attrs["who"] == "us" and found.attrs["many"].tolist() == [0, 1, 2]
    assert isinstance(found["group"], Group) and "x" not in found and len(found) == len(VALUES) + 2
    with pytest.raises(KeyError):
        found["doubles/x"]


def test_what_shrinks_much_is_sent_where_it_is_asked_for(file: Path) -> None:
    packed = opened_apart(file)["packed"]
    assert isinstance(packed, Array) and packed.shape == (10**6,) and packed.stored < 20_000
    assert packed[:5].tolist() == [0.0] * 5 and len(packed[()]) == 10**6


def test_arrays_may_be_changed(file: Path) -> None:
    """As those of h5py: SciPy sorts the indices of a matrix where they are."""
    opened_apart(file).array("doubles")[0] = 7


def test_nothing_leads_out_of_the_file(file: Path, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "b.h5", "w") as content:
        content["out"] = h5py.ExternalLink("a.h5", "/doubles")
        content["group"] = h5py.ExternalLink("a.h5", "/group")
        content["through"] = h5py.SoftLink("/group/deep/er")
        content.create_dataset("stored", (3,), "f8", external=[("/etc/passwd", 0, 24)])
    found = opened_apart(tmp_path / "b.h5")
    assert {name: entry.kind for name, entry in found.items() if isinstance(entry, Link)} == {
        "out": "ExternalLink",
        "group": "ExternalLink",
        "through": "SoftLink",
    }
    stored = found["stored"]
    assert isinstance(stored, Array) and stored.elsewhere
    with pytest.raises(InputError, match="got data stored in others"):
        stored[()]


def test_a_soft_link_through_another_file_is_not_a_problem(tmp_path: Path) -> None:
    """h5py follows it: a soft link whose way leads through an external one."""
    problem = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3]))
    write_fclib(tmp_path / "other.hdf5", problem)
    path = write_fclib(tmp_path / "a.hdf5", problem)
    with h5py.File(path, "r+") as content:
        del content["fclib_local/vectors/q"]
        content["far"] = h5py.ExternalLink("other.hdf5", "/fclib_local")
        content["fclib_local/vectors/q"] = h5py.SoftLink("/far/vectors/q")
    with pytest.raises(InputError, match=r"a\.hdf5: /fclib_local/vectors/q: expected the problem within this file, got a soft link"):
        read_fclib(path)


@pytest.mark.parametrize(
    ("does", "said"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", r"ends its reader \(SIGSEGV"),
        ("os._exit(7)", r"ends its reader \(exit code 7"),
        ("while True: pass", r"ends its reader \(more than 1 s of the processor"),
        ("return {'error': str(len(bytearray(2**36)))}", "truncated or damaged"),
        ("os.write(4, b'{'); os._exit(0)", "ends its reader"),
        ("import time; time.sleep(60)", "can be read in 2 s"),
    ],
)
def test_what_a_file_does_to_its_reader_is_one_error(file: Path, reader: pytest.MonkeyPatch, does: str, said: str) -> None:
    """And the next file is read."""
    for name, value in {"SECONDS": 1, "SECONDS_PER_MB": 0.0}.items():
        reader.setattr(hdf5_process, name, value)
    if "sleep" in does:
        reader.setattr(hdf5_process, "PATIENCE", 2.0)
    begin = time.thread_time()
    with reader.context() as changed:
        mad(changed, does)
        with pytest.raises(InputError, match=said):
            opened_apart(file)
        hdf5_process._at_the_end()
    assert time.thread_time() - begin < 1
    assert len(opened_apart(file)) > 3


def test_a_reader_that_was_killed_is_begun_anew(file: Path, reader: pytest.MonkeyPatch) -> None:
    opened_apart(file)
    process = hdf5_process._PROCESS[0]
    os.kill(process.pid, signal.SIGKILL)
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    assert len(opened_apart(file)) > 3


def test_an_interrupt_leaves_no_answer_for_the_next(file: Path, reader: pytest.MonkeyPatch) -> None:
    opened_apart(file)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with reader.context() as changed:
        changed.setattr(hdf5_process, "decoded", interrupted)
        with pytest.raises(KeyboardInterrupt):
            opened_apart(file)
    assert not hdf5_process._PROCESS
    assert len(opened_apart(file)) > 3


def test_a_fork_has_a_reader_of_its_own(file: Path) -> None:
    opened_apart(file)
    own = hdf5_process._PROCESS[0].pid
    child = os.fork()
    if child == 0:
        code = 1
        try:
            if opened_apart(file).array("doubles")[-1] == 1.0 and hdf5_process._PROCESS[0].pid != own:
                code = 0
            hdf5_process._at_the_end()
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0
    assert opened_apart(file).array("doubles")[-1] == 1.0 and hdf5_process._PROCESS[0].pid == own


def test_circles_and_crowds(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as content:
        content["g/x"] = 1.0
        for k in range(4):
            content[f"g/again{k}"] = content["g"]
    with pytest.raises(InputError, match="groups in a circle"):
        opened_apart(tmp_path / "a.h5")


def test_a_name_that_is_no_utf8(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as content:
        content.create_group(b"\xff\xfe")
    assert list(opened_apart(tmp_path / "a.h5")) == ["\udcff\udcfe"]


OF_ANOTHER = """
import os, sys
from fcsim.apart import opened_apart
from fcsim.errors import InputError
from pathlib import Path
if os.geteuid() == 0:
    os.setresuid(65534, 65534, 65534)
try:
    opened_apart(Path(sys.argv[1]))
except InputError as error:
    print(error)
"""


def test_a_file_that_may_not_be_read_is_not_called_damaged(file: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:  # that another user may enter, as tmp_path is not
        Path(folder).chmod(0o755)
        secret = Path(folder) / "a.h5"
        secret.write_bytes(file.read_bytes())
        secret.chmod(0o000)
        done = subprocess.run([sys.executable, "-c", OF_ANOTHER, secret], capture_output=True, text=True, timeout=120)
    assert done.stdout == "expected a file that this user may read, got: Permission denied\n", done.stderr
