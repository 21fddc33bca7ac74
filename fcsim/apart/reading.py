"""Mesh files of others: `read_apart` waits for the process that reads one, `limited` is what that does."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from fcsim.errors import InputError, MissingDependency
from fcsim.files import regular
from fcsim.runtime import ISOLATED

PROCESS = "import sys; from {module} import main; raise SystemExit(main(*sys.argv[1:]))"
SECONDS, SECONDS_PER_MB = 60.0, 5.0
"""A reader may take so long: some MB a second is what the slowest formats are read at."""
MEMORY, MEMORY_PER_BYTE = 4 * 2**30, 100
"""[bytes] of addresses, libraries included."""


def read_apart[T](path: Path, module: str, arguments: Sequence[str], loaded: Callable[[Path], T]) -> T:
    """What `loaded` makes of the arrays (.npz) that `main(path, out, *arguments)` of a module of ours wrote in another process.

    InputError for what that says of the file, and where it crashes, hangs or fills memory.
    """
    megabytes = regular(path).stat().st_size / 1e6
    with TemporaryDirectory(prefix="fcsim-mesh-") as folder:
        environment = with_our_modules() | {"TMPDIR": folder}  # what a reader that crashes leaves behind goes with it
        out = Path(folder) / "mesh.npz"
        command = [sys.executable, ISOLATED, "-c", PROCESS.format(module=module), str(path), str(out), *arguments]
        patience = SECONDS + SECONDS_PER_MB * megabytes
        try:
            done = subprocess.run(command, env=environment, capture_output=True, timeout=patience, check=False, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"{path}: expected a mesh that can be read in {error.timeout:.0f} s, its reader was still at it") from None
        if done.returncode == 2:
            told = json.loads(done.stdout.decode().splitlines()[-1])
            raise (MissingDependency if told["missing"] else InputError)(told["error"])
        if done.returncode != 0:
            last = "".join(done.stderr.decode(errors="replace").strip().splitlines()[-1:])
            how = signal.Signals(-done.returncode).name if done.returncode < 0 else last or f"exit code {done.returncode}"
            raise InputError(f"{path}: expected a mesh file, got one that ends its reader ({how})")
        return loaded(out)


def with_our_modules() -> dict[str, str]:
    """The environment in which another Python finds this fcsim."""
    known = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, known))}


def limited(path: str, read: Callable[[], None]) -> int:
    """Read within the limits; what is wrong with the file is printed as JSON, exit code 2."""
    size = Path(path).stat().st_size
    most = MEMORY + MEMORY_PER_BYTE * size
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        read()
    except (InputError, MissingDependency) as error:
        print("\n" + json.dumps({"error": str(error), "missing": isinstance(error, MissingDependency)}))
        return 2
    except MemoryError:
        print("\n" + json.dumps({"error": f"{path}: expected a mesh that fits into {most / 2**30:.1f} GiB", "missing": False}))
        return 2
    return 0
