"""What a shell that asks is answered: by argcomplete's own protocol, in a process as a shell starts it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fcsim.command_line.main import main

pytest.importorskip("argcomplete")
ROOT = Path(__file__).parents[4]


def completed(line: str, folder: Path) -> set[str]:
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": str(folder / "words"), "COMP_LINE": line, "COMP_POINT": str(len(line))}
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "_ARGCOMPLETE_IFS": "\n", **asked}
    code = "import sys; sys.argv[0] = 'fcsim'; from fcsim.command_line.main import main; main()"
    subprocess.run([sys.executable, "-c", code], env=environment, cwd=folder, capture_output=True, timeout=120, check=False)
    return {word.strip() for word in (folder / "words").read_text().split("\n")}


def test_cases_and_their_parameters(tmp_path: Path) -> None:
    assert completed("fcsim run masonry", tmp_path) == {"masonry_wall"}
    assert {"blocks=", "block_size=", "blocks_are="} == completed("fcsim run masonry_wall --set block", tmp_path)
    assert {"friction=scripts", "friction=paper"} <= completed("fcsim run masonry_wall --set friction=", tmp_path)


def test_commands_and_solvers(tmp_path: Path) -> None:
    assert {"cases", "collection", "compare", "completion"} == completed("fcsim c", tmp_path)
    assert {"NSN-AC", "NSN-AC-NLS"} <= completed("fcsim solve file.hdf5 --solver NSN-A", tmp_path)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_shells_code_names_fcsim(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert "fcsim" in capsys.readouterr().out
