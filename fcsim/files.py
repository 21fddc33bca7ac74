"""Writing files whole: under a temporary name in the same folder, renamed when complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`, which takes the place of `path` if the block ends well and is removed if it does not."""
    temporary = path.with_name(f".{path.stem}.partial{path.suffix}")  # programs choose formats by the extension
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
