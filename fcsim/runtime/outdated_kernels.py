"""Compiled kernels whose sources have changed."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Set
from contextlib import suppress
from pathlib import Path

MARK = "sources_seen"
"""In the package's __pycache__: its time is that at which sources were last looked at."""
_IMPORTED = re.compile(r"^from fcsim\.([\w.]+) import", re.MULTILINE)


def forget_outdated_kernels(package: Path) -> None:
    """Remove what numba keeps beside the sources of the package (its folder) of kernels that call or take constants from another file
    which has changed since.

    numba looks at a function's own file alone: after an update of a clone that changes what a kernel calls, it went on with the code
    before, without a word. Nothing is done where NUMBA_CACHE_DIR says where the cache is, or where the folder cannot be written.
    """
    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    mark, now = package / "__pycache__" / MARK, time.time_ns()
    with suppress(OSError):
        seen = mark.stat().st_mtime_ns if mark.exists() else 0
        changed = _changed(package, seen)
        if changed:
            for file in _built_on(changed, package):
                for index in (file.parent / "__pycache__").glob(f"{file.stem}.*.nbi"):
                    index.unlink(missing_ok=True)
            mark.parent.mkdir(exist_ok=True)
            mark.touch()
            os.utime(mark, ns=(now, now))


def _changed(package: Path, since: int) -> set[Path]:
    """Sources that were written after that time [ns]."""
    found: set[Path] = set()
    for entry in os.scandir(package):
        if entry.is_dir():
            found |= _changed(Path(entry.path), since) if entry.name != "__pycache__" else set()
        elif entry.name.endswith(".py") and entry.stat().st_mtime_ns > since:
            found.add(Path(entry.path))
    return found


def _built_on(changed: Set[Path], package: Path) -> set[Path]:
    """Files of kernels that import one of those, or a file of kernels that does."""
    texts = {file: file.read_text("utf-8") for file in package.rglob("*.py")}
    imports = {
        file: {package / f"{name.replace('.', '/')}{end}" for name in _IMPORTED.findall(text) for end in (".py", "/__init__.py")}
        for file, text in texts.items()
        if "njit" in text
    }
    found = changed & imports.keys()
    reached = set(changed)
    while reached:
        reached = {file for file, of in imports.items() if file not in found and not of.isdisjoint(reached)}
        found |= reached
    return found
