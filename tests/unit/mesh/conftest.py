"""Mesh and surface files read by this process instead of one of their own, for tests of what is read rather than of how."""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

import pytest

from fcsim.files import regular
from fcsim.mesh import foreign
from fcsim.mesh.solids import surface_file


@pytest.fixture
def read_here(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same `main` of the same module writes the same arrays, without limits: a process begins with a second of imports.

    test_foreign.py and tests/faults keep the processes.
    """

    def read[T](path: Path, module: str, arguments: Sequence[str], loaded: Callable[[Path], T]) -> T:
        out = tmp_path_factory.mktemp("read") / "mesh.npz"
        assert regular(path) and import_module(module).main(str(path), str(out), *arguments) == 0
        return loaded(out)

    def unlimited(path: str, work: Callable[[], None]) -> int:
        work()
        return 0

    for module in (foreign, surface_file):
        monkeypatch.setattr(module, "read_apart", read)
        monkeypatch.setattr(module, "limited", unlimited)
