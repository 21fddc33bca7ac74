"""Writing files whole: under a temporary name in the same folder, renamed when complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`, which takes the place of `path` if the block ends well and is removed if it does not."""
    temporary = path.with_name(f".{path.stem}.partial{path.suffix}")  # programs choose formats by the extension
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.errno is not None and error.filename is None:  # a full disk does not say which file it was
            error.filename = str(path)
        raise
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def replacing_hdf5(path: Path) -> Iterator[h5py.File]:
    """Yield a new HDF5 file in memory, written to `path` as a whole if the block ends well.

    On a disk that is full HDF5 can neither write nor close a file, and its process ends in a segmentation fault; a file in memory is
    written with an OSError that can be told, and faster.
    """
    with h5py.File(path.name, "w", driver="core", backing_store=False, block_size=2**20) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with replacing(path) as temporary:
        temporary.write_bytes(image)
