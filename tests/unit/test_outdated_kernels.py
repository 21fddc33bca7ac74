"""What numba keeps of kernels goes where a file that they call has changed: numba itself looks at a kernel's own file alone."""

import os
from pathlib import Path

import pytest

from fcsim.runtime import forget_outdated_kernels

SOURCES = {
    "law/_helper_kernels.py": "from numba import njit\n",
    "law/_caller_kernels.py": "from numba import njit\nfrom fcsim.law._helper_kernels import helper\n",
    "far/_farther_kernels.py": "from fcsim.law._caller_kernels import njit\nfrom fcsim.law.constants import ONE\n",
    "far/_other_kernels.py": "from numba import njit\n",
    "law/constants.py": "ONE = 1.0\n",
}
KERNELS = {file for file in SOURCES if file != "law/constants.py"}


def kept(package: Path) -> set[str]:
    """Kernels whose index is there."""
    return {f"{index.parents[1].name}/{index.name.split('.')[0]}.py" for index in package.rglob("*.nbi")}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Looked at once; then all of its kernels are compiled."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    for name, text in SOURCES.items():
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        os.utime(file, (1.0, 1.0))
    forget_outdated_kernels(tmp_path)
    for name in KERNELS:
        index = tmp_path / name
        (index.parent / "__pycache__").mkdir(exist_ok=True)
        (index.parent / "__pycache__" / f"{index.stem}.some_function-12.py312.nbi").touch()
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "gone"),
    [
        (None, set()),
        ("law/_helper_kernels.py", {"law/_helper_kernels.py", "law/_caller_kernels.py", "far/_farther_kernels.py"}),
        ("law/constants.py", {"far/_farther_kernels.py"}),
        ("far/_other_kernels.py", {"far/_other_kernels.py"}),
    ],
)
def test_what_calls_a_changed_file_is_compiled_anew(package: Path, changed: str | None, gone: set[str]) -> None:
    if changed is not None:
        (package / changed).touch()
    forget_outdated_kernels(package)
    assert kept(package) == KERNELS - gone


def test_what_was_compiled_before_sources_were_looked_at_goes(package: Path) -> None:
    next((package / "__pycache__").iterdir()).unlink()
    forget_outdated_kernels(package)
    assert kept(package) == set()


def test_a_cache_elsewhere_is_left_alone(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(package / "elsewhere"))
    (package / "law/_helper_kernels.py").touch()
    forget_outdated_kernels(package)
    assert kept(package) == KERNELS
