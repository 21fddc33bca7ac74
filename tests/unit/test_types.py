"""mypy --strict accepts what users write, without ignores: the README's example, a new case, a guide's case, every script of the cases."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SETTINGS = "[mypy]\nstrict = True\nfollow_imports = silent\n[mypy-scipy.*]\nignore_missing_imports = True\n"


def scripts(folder: Path) -> list[Path]:
    texts = {
        "readme": re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)[0],
        "guide": re.findall(
            r"^```python\n(.*?)^```", (ROOT / "docs/guides/add_a_case.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
        )[0],
        "new": (ROOT / "fcsim/command_line/start/template.py").read_text(encoding="utf-8"),
        **{path.stem: path.read_text(encoding="utf-8") for path in sorted(ROOT.glob("cases/*/*.py"))},
        "wrong": "from fcsim import Material, Theta\n\nMaterial(E='2e9', nu=0.2, density=2000.0)\nTheta(h=1e-3).step\n",
    }
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return [folder / f"{name}.py" for name in texts]


@pytest.mark.slow
def test_scripts_of_users_pass_strict_types(tmp_path: Path) -> None:
    """fcsim as it is installed: its own types are read, its own errors not shown. A wrong script is seen to be wrong.

    SciPy, which some cases use themselves, has no types of its own.
    """
    (tmp_path / "mypy.ini").write_text(SETTINGS, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", *(path.name for path in scripts(tmp_path))]
    environment = {**os.environ, "MYPYPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=900, check=False)
    errors = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert [line.split(":")[0] for line in errors] == ["wrong.py", "wrong.py"], done.stdout + done.stderr
