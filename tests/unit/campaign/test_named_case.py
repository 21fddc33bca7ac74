"""Which case a path stands for, and what is loaded for it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fcsim.campaign.named_case import named_case
from fcsim.errors import InputError
from fcsim.masonry.case import Parameters

CASES = Path(__file__).resolve().parents[3] / "cases"
LOADED = """
import sys
from fcsim.campaign.named_case import named_case
from fcsim.running.run import run_case
named_case(sys.argv[1])
print("fcsim.masonry" in sys.modules)
"""


@pytest.mark.parametrize("path", ["stack", str(CASES / "stack"), str(CASES / "stack" / "stack.py")], ids=["name", "folder", "script"])
def test_a_name_a_folder_and_a_script_are_one_case(path: str) -> None:
    assert named_case(path).name == "stack"


def test_a_file_of_blocks_is_a_masonry_case(tmp_path: Path) -> None:
    """It is read when the case is built."""
    model = tmp_path / "two.JSON"
    model.write_text("{}")
    assert named_case(model).parameters is Parameters


@pytest.mark.parametrize("path", ["none.py", "none", "none.xyz"])
def test_what_is_not_there_is_refused(path: str) -> None:
    with pytest.raises(InputError, match="none"):
        named_case(path)


def test_a_script_does_not_load_the_masonry_room() -> None:
    said = subprocess.run([sys.executable, "-c", LOADED, str(CASES / "stack")], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["False"]
