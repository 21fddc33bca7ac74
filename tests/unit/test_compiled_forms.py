"""What a process leaves in the folder of compiled forms that was killed while it compiled one."""

import fcntl
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from fcsim import runtime
from fcsim.errors import InputError
from fcsim.runtime import compiled_forms

type Compile = Callable[[], object]


@pytest.fixture(scope="module")
def dolfinx() -> ModuleType:
    pytest.importorskip("petsc4py")
    return runtime.dolfinx()


@pytest.fixture
def compile_length(dolfinx: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Compile:
    """A form in a folder of its own, where ffcx waits a second for others instead of ten."""
    import ufl
    from mpi4py import MPI

    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cache_dir", (tmp_path, ""))
    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "timeout", (1, ""))
    mesh = dolfinx.mesh.create_unit_interval(MPI.COMM_SELF, 1)
    length = dolfinx.fem.Constant(mesh, 2.0) * ufl.dx(mesh)
    return lambda: dolfinx.fem.assemble_scalar(runtime.compiled_form(length))


@pytest.fixture
def killed(compile_length: Compile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The C file as a signal leaves it that comes while ffcx writes the code."""
    from ffcx.codegeneration import jit

    def die(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(jit, "_compile_objects", die)
        with pytest.raises(KeyboardInterrupt):
            compile_length()
    (left,) = tmp_path.iterdir()
    assert left.stat().st_size == 0
    return left


@pytest.mark.parametrize("age", [3600.0, -3600.0])
def test_an_abandoned_form_is_compiled_anew(killed: Path, compile_length: Compile, age: float) -> None:
    os.utime(killed, (time.time() - age,) * 2)
    assert compile_length() == pytest.approx(2.0)
    assert killed.with_suffix(".c.cached").exists()


def test_of_one_who_may_still_compile_nothing_is_taken(
    killed: Path, compile_length: Compile, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it waits for is said, once: it was silent for up to a minute. The file's age each time one looks is the test's."""
    ages = [share * compiled_forms.ABANDONED for share in (1.01, 0.99, 0.02)]
    changed = killed.stat().st_mtime
    monkeypatch.setattr(compiled_forms, "time", SimpleNamespace(time=lambda: changed + ages.pop()))
    assert compile_length() == pytest.approx(2.0)
    assert not ages
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"fcsim: waits for a form that another process compiles ({killed})")


def test_who_is_interrupted_leaves_nothing(compile_length: Compile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while the C compiler runs left a file, for which the next run waited a minute."""
    import cffi

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(cffi.FFI, "compile", interrupted)
        with pytest.raises(KeyboardInterrupt):
            compile_length()
    assert not list(tmp_path.glob("*.c"))
    assert compile_length() == pytest.approx(2.0)


def test_who_is_interrupted_while_he_waits_takes_nothing(killed: Path, compile_length: Compile, monkeypatch: pytest.MonkeyPatch) -> None:
    from ffcx.codegeneration import jit

    def interrupted(_: float) -> None:
        raise KeyboardInterrupt

    os.utime(killed)
    monkeypatch.setattr(jit.time, "sleep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        compile_length()
    assert killed.exists()


def test_what_cannot_be_removed_is_named(killed: Path, compile_length: Compile, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path) -> None:
        raise PermissionError(13, "Permission denied")

    os.utime(killed, (0, 0))
    monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(InputError, match=rf"{killed.name}.*killed.*Permission denied.*remove the file"):
        compile_length()


def test_of_several_that_waited_one_takes_it_away(killed: Path) -> None:
    """The second comes to the first's new file, or to none: by a lock on the old one, which it must not remove nor fail at."""
    os.utime(killed, (0, 0))
    with killed.open("rb") as file, ThreadPoolExecutor(1) as second:
        fcntl.flock(file, fcntl.LOCK_EX)
        taken = second.submit(compiled_forms._take_away_abandoned, killed)
        time.sleep(0.1)
        assert not taken.done()
        killed.unlink()
        killed.touch()
        fcntl.flock(file, fcntl.LOCK_UN)
        assert not taken.result(timeout=60)
    assert killed.exists()
    killed.unlink()
    assert not compiled_forms._take_away_abandoned(killed)
