"""How many small errors the tests see: Cosmic Ray's mutations of a few modules, each run against the tests that are about them.

    python tools/mutation.py                          all modules, 60 mutations of each, drawn with seed 1
    python tools/mutation.py --each 0 cone judge      all mutations of two modules
    python tools/mutation.py --out survivors.txt      and the survivors as differences

A mutation is killed where a test fails or runs longer than ten times what it takes unharmed. Operators that change nothing but the
annotations (`X | None`) and those that give the same program (`is` for `==` of small numbers) are left out. Compiled kernels run as plain
Python, since their cache does not see what they are made of, but for the modules that compute nothing (COMPILED). Needs the extra
`mutation`, which `make mutation` installs. The score is in docs/promises.md.
"""

from __future__ import annotations

import argparse
import difflib
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.dont_write_bytecode = True
os.environ["OMP_NUM_THREADS"] = "1"  # before NumPy

import h5py  # noqa: E402, F401 - for the forks
import hypothesis  # noqa: E402, F401
import numba  # noqa: E402
import pytest  # noqa: E402
import scipy.sparse.linalg  # noqa: E402, F401

ROOT = Path(__file__).resolve().parents[1]
MODULES: dict[str, tuple[str, tuple[str, ...]]] = {
    "cone": ("fcsim/problem/cone.py", ("tests/unit/problem/test_cone.py",)),
    "cone kernels": ("fcsim/problem/_cone_kernels.py", ("tests/unit/problem/test_cone.py",)),
    "problem": ("fcsim/problem/problem.py", ("tests/unit/problem/test_problem.py",)),
    "judge": ("fcsim/problem/judge.py", ("tests/unit/problem/test_judge.py",)),
    "judge kernels": ("fcsim/problem/_judge_kernels.py", ("tests/unit/problem/test_judge.py",)),
    "contact matrix": ("fcsim/contact_detection/contact_matrix.py", ("tests/unit/contact_detection/test_frames_and_matrix.py",)),
    "contact matrix kernels": (
        "fcsim/contact_detection/_contact_matrix_kernels.py",
        ("tests/unit/contact_detection/test_frames_and_matrix.py",),
    ),
    "checkpoint": ("fcsim/running/checkpoint.py", ("tests/unit/running/test_checkpoint.py",)),
    "folder": ("fcsim/running/folder.py", ("tests/unit/running/test_folder.py",)),
}
ALIKE = re.compile(
    r"ReplaceBinaryOperator_BitOr_|ReplaceComparisonOperator_(Eq_Is|NotEq_IsNot|Is_Eq|IsNot_NotEq)$|RemoveDecorator|Variable"
)
"""`|` here is of types; `is` and `==` agree on None and on enumerations; a kernel without @njit is the kernel; two operators want names."""


def mutations(code: str) -> list[tuple[str, int]]:
    """(operator, occurrence) of every mutation of a module."""
    from cosmic_ray.ast import get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    tree, found = get_ast(code), []
    nodes = [tree]
    while nodes:
        node = nodes.pop()
        nodes += getattr(node, "children", [])
        for name in operator_names():
            if ALIKE.search(name):
                continue
            found += [name] * len(list(get_operator(name)().mutation_positions(node)))
    return [(name, k) for name in sorted(set(found)) for k in range(found.count(name))]


def mutated(code: str, name: str, occurrence: int) -> str | None:
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    try:
        return mutate_code(code, get_operator(name)(), occurrence)
    except AttributeError:  # exceptions that have a module before their name are more than its operator for them knows
        return None


COMPILED = ("checkpoint", "folder")
"""Modules whose tests load kernels that are compiled as they are loaded."""


def passes(copy: Path, tests: Sequence[str], patience: float, compiled: bool) -> bool:
    """Whether the tests pass in the copy of the repository, in time: in a fork of this process, which has what fcsim needs loaded."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            silence = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silence, 1)
            os.dup2(silence, 2)
            numba.config.DISABLE_JIT = int(not compiled)  # read where a kernel is decorated
            os.chdir(copy)
            sys.path.insert(0, str(copy))
            code = int(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests]))
        finally:
            os._exit(code)
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status == 0
        time.sleep(0.02)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def score(name: str, each: int, copy: Path, out: list[str]) -> tuple[int, int]:
    """(killed, tried) of one module; the differences that survived go to `out`."""
    place, tests = MODULES[name]
    original = (ROOT / place).read_text(encoding="utf-8")
    begin = time.monotonic()
    if not passes(copy, tests, 600.0, name in COMPILED):
        raise SystemExit(f"{name}: its tests fail unharmed: {' '.join(tests)}")
    patience = 10 * (time.monotonic() - begin) + 10
    chosen = mutations(original)
    if each and len(chosen) > each:
        chosen = sorted(random.Random(f"1 {name}").sample(chosen, each))
    killed = tried = 0
    for operator, occurrence in chosen:
        text = mutated(original, operator, occurrence)
        if text is None or text == original:
            continue
        (copy / place).write_text(text, encoding="utf-8")
        tried += 1
        if passes(copy, tests, patience, name in COMPILED):
            changed = difflib.unified_diff(original.splitlines(), text.splitlines(), place, operator, n=0, lineterm="")
            out.append("\n".join(changed))
            print(out[-1], flush=True)
        else:
            killed += 1
    (copy / place).write_text(original, encoding="utf-8")
    return killed, tried


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("modules", nargs="*", help=f"of {', '.join(MODULES)} (default: all)")
    parser.add_argument("--each", type=int, default=60, help="mutations drawn of each module, 0 = all (default 60)")
    parser.add_argument("--out", type=Path, help="file for the survivors")
    options = parser.parse_args()
    survivors: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        copy.mkdir()
        for part in ("fcsim", "tests", "cases", "pyproject.toml"):
            if (ROOT / part).is_dir():
                shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / part, copy / part)
        total = [0, 0]
        for name in options.modules or MODULES:
            killed, tried = score(name, options.each, copy, survivors)
            total = [total[0] + killed, total[1] + tried]
            print(f"{name}: {killed} of {tried} killed, {killed / max(tried, 1):.0%}", flush=True)
    print(f"together: {total[0]} of {total[1]} killed, {total[0] / max(total[1], 1):.1%}")
    if options.out is not None:
        options.out.write_text("\n\n".join(survivors) + "\n", encoding="utf-8")
    return 0 if total[0] >= 0.85 * total[1] else 1


if __name__ == "__main__":
    sys.exit(main())
