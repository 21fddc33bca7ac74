"""`mpiexec -n N fcsim run` of a body that ranks have together: what it writes, how it ends, how it goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.assembly.over_ranks import pieces
from fcsim.command_line.main import main
from fcsim.export_fclib import read_fclib
from fcsim.problem import GlobalProblem
from fcsim.running.folder import open_run
from tests.unit.ranks.conftest import Ended, Program
from tests.unit.ranks.test_shared_run import PARAMETERS, Rows, seconds_since, spoiled, whole

SPREAD = "from fcsim.assembly.over_ranks import pieces\npieces.SPREAD_FROM, pieces.SPREAD_SHARE = 4, 0.0\n"
pytestmark = pytest.mark.slow


@pytest.fixture
def together(case_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The case of two blocks, which ranks have together however small they are."""
    for name in ("SPREAD_FROM", "SPREAD_SHARE"):  # the script sets them in this process, too
        monkeypatch.setattr(pieces, name, getattr(pieces, name))
    script = case_folder / "two_blocks.py"
    text = script.read_text(encoding="utf-8")
    script.write_text(text.replace("def build(p):", f"{SPREAD}\n\ndef build(p):"), encoding="utf-8")
    return case_folder


@pytest.fixture
def run(mpiexec: Program, tmp_path: Path) -> Callable[..., Ended]:
    def start(ranks: int, case: Path, *arguments: str) -> Ended:
        return mpiexec(ranks, "-m", "fcsim", "run", case, "--out", tmp_path / "out", *PARAMETERS, *arguments)

    return start


def numbers(rows: list[dict[str, str]], column: str) -> np.ndarray:
    return np.array([float(row[column]) for row in rows])


def test_what_one_process_writes_within_the_tolerance(
    run: Callable[..., Ended], together: Path, tmp_path: Path, steps_without_seconds: Rows
) -> None:
    """And goes on with another number of ranks: 2, then 3, then 1; the problems' M is whole in FCLIB files."""
    assert main(["run", str(together), "--out", str(tmp_path / "alone"), *PARAMETERS, "--quiet"]) == 0
    for ranks, steps in ((2, 5), (3, 9)):
        ended = run(ranks, together, "--steps", str(steps), *(["--resume"] if ranks > 2 else []))
        assert ended.code == 0, ended.err
    assert main(["run", str(together), "--out", str(tmp_path / "out"), *PARAMETERS, "--resume", "--steps", "12", "--quiet"]) == 0
    got, wanted = steps_without_seconds(tmp_path / "out"), steps_without_seconds(tmp_path / "alone")
    for column in ("nc", "sticking", "sliding"):
        assert np.array_equal(numbers(got, column), numbers(wanted, column))
    for column in ("kinetic_energy", "elastic_energy"):
        assert np.allclose(numbers(got, column), numbers(wanted, column), rtol=1e-6, atol=1e-12)
    for path in sorted((tmp_path / "alone/fclib/global").iterdir()):
        step = path.stem.split("-")[-1]
        one, other = (read_fclib(next((tmp_path / folder / "fclib/global").glob(f"*-{step}.hdf5"))).problem for folder in ("alone", "out"))
        assert isinstance(one, GlobalProblem) and isinstance(other, GlobalProblem)
        assert abs(one.M - other.M).max() <= 1e-13 * abs(one.M).max()
    with h5py.File(tmp_path / "alone/checkpoint.h5") as one_file, h5py.File(tmp_path / "out/checkpoint.h5") as other_file:
        assert np.allclose(one_file["x"][()], other_file["x"][()], rtol=0, atol=1e-8 * np.abs(one_file["x"][()]).max())


@pytest.mark.parametrize("how", ["raise ZeroDivisionError('of this rank')", "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"])
def test_a_rank_that_ends_ends_all(run: Callable[..., Ended], together: Path, tmp_path: Path, how: str) -> None:
    ended = run(2, spoiled(together, how))
    assert ended.code != 0 and seconds_since(tmp_path / "spoiled") < 30
    assert open_run(tmp_path / "out").description.status in ("failed", "interrupted")
    whole(tmp_path / "out")


def test_a_rank_that_is_killed_in_an_exchange(
    run: Callable[..., Ended], together: Path, tmp_path: Path, steps_without_seconds: Rows
) -> None:
    """While the other one is within MUMPS; another number of ranks goes on."""
    script = together / "two_blocks.py"
    innocent = script.read_text(encoding="utf-8")
    kill = (
        "import os, signal\nfrom contextlib import contextmanager\nfrom fcsim.ranks import world\n"
        "SIGN = Path(__file__).parents[1] / 'out/checkpoint.h5'\n\n\n@contextmanager\ndef killed():\n"
        "    if os.environ.get('PMI_RANK') == '1' and SIGN.exists():\n        os.kill(os.getpid(), signal.SIGKILL)\n    yield\n\n\n"
        "sys.modules['fcsim.ranks.world'].held_back = killed\n"
    )
    script.write_text(innocent.replace(SPREAD, SPREAD + kill), encoding="utf-8")
    assert run(2, together).code != 0
    whole(tmp_path / "out")
    script.write_text(innocent, encoding="utf-8")
    ended = run(3, together, "--resume", "--accept-changes")
    assert ended.code == 0, ended.err
    assert len(steps_without_seconds(tmp_path / "out")) == 12
