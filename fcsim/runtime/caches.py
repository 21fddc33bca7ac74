"""Where what is compiled is kept."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path


def writable_caches() -> None:
    """Let compiled forms (ffcx) and functions (numba) be kept in a private folder for temporary files where HOME cannot be written."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache")  # noqa: PTH111 - Path.home() may raise
    existing = next((folder for folder in (cache, *cache.parents) if folder.exists()), Path("/"))
    if os.access(existing, os.W_OK | os.X_OK) and not existing.as_posix().startswith("/proc"):
        return
    private = Path(tempfile.gettempdir()) / f"fcsim-cache-{os.getuid()}"
    try:
        private.mkdir(mode=0o700, exist_ok=True)
        about = private.lstat()
        if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or about.st_mode & 0o077:  # what is compiled is loaded
            private = Path(tempfile.mkdtemp(prefix="fcsim-cache-"))
    except OSError:
        return
    os.environ["XDG_CACHE_HOME"] = str(private)
    if not os.access(Path(__file__).parents[1], os.W_OK):
        os.environ.setdefault("NUMBA_CACHE_DIR", str(private / "numba"))
