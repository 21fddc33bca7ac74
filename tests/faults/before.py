"""What commit f68a169, before the mends of issue 17, did with the faults of README.md's table: rows of it, run again on that commit.

    git worktree add PLACE f68a169
    python tests/faults/before.py PLACE            all of before.txt, some minutes
    python tests/faults/before.py PLACE 2b 12c     two of them

A row is a program that runs with the old code in a folder of its own; the row is seen where what it prints holds the words after "says".
7c mounts a small file system; all need what fcsim needs.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

BEGIN = """
import sys, os, json, traceback, time, signal, resource, subprocess
from pathlib import Path
import numpy as np
np.seterr(all="ignore")
FCSIM = [sys.executable, "-m", "fcsim"]
CASES = Path(os.environ["PYTHONPATH"]) / "cases"
def fcsim(*words, **more):
    done = subprocess.run([*FCSIM, *map(str, words)], capture_output=True, text=True, errors="replace", **more)
    return f"exit code {done.returncode}: {done.stdout[-1500:]} {done.stderr[-1500:]}"
def caught(call):
    try:
        return f"returned {call()!r}"[:300]
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {str(error)[:200]} at {Path(where.filename).name}"
def one_contact(k=1.0):
    from fcsim.problem import LocalProblem
    return LocalProblem(k * np.eye(3), np.array([-1.0, 0.1 * k, 0]), np.array([0.3]))
def stack(out, *words):
    return fcsim("run", CASES / "stack", "--out", out, "--steps", 3, *words)
"""
"""What the programs begin with."""


def rows() -> dict[str, tuple[str, str, str]]:
    """Name -> (phrase, what it says, program)."""
    found = {}
    for part in Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").split("#### ")[1:]:
        head, _, rest = part.partition("\n")
        if not head.startswith("says: "):
            name, _, phrase = head.partition(": ")
            continue
        found[name] = phrase, head.removeprefix("says: "), rest
    return found


def came(old: Path, program: str) -> str:
    """What a row's program prints with the old code, errors included."""
    with tempfile.TemporaryDirectory() as place:
        done = subprocess.run(
            [sys.executable, "-c", BEGIN + program],
            cwd=place,
            env={**os.environ, "PYTHONPATH": str(old), "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            errors="replace",
            timeout=300,
            check=False,
        )
    return done.stdout.strip() + ("" if done.returncode == 0 else f"\n{done.stderr.strip()[-1500:]}")


def main() -> int:
    known = rows()
    old, names = Path(sys.argv[1]).resolve(), sys.argv[2:] or list(known)
    missing = []
    for name in names:
        phrase, says, program = known[name]
        answer = came(old, program)
        if not re.search(says, answer):
            missing.append(name)
        print(f"{name} {'NOT SEEN' if name in missing else 'seen'}: {phrase}\n    {' '.join(answer.split())[:400]}", flush=True)
    print(f"{len(names) - len(missing)} of {len(names)} seen{': not ' if missing else ''}{', '.join(missing)}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
