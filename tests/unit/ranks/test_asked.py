"""What a launcher says, and that one process pays nothing for ranks."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fcsim import ranks

ALONE = """
import sys
import fcsim.running.run
from fcsim import ranks
with ranks.sharing() as world, ranks.alone(), ranks.section("x"):
    assert world is None and ranks.world() is None and ranks.writes() and not ranks.shared()
    assert ranks.of_rank_0("x", lambda: 3) == 3 and ranks.told("x", 4) == 4
assert not [name for name in sys.modules if name.split(".")[0] in ("mpi4py", "petsc4py")]
assert "scipy.optimize" not in sys.modules, "a tenth of a second of every start"
"""


def test_one_process_does_not_load_mpi() -> None:
    """Nor linear programming, which few problems need."""
    subprocess.run([sys.executable, "-c", ALONE], check=True, timeout=60)


@pytest.mark.parametrize("name", ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE"])
def test_the_number_of_ranks(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    assert (ranks.asked_ranks(), ranks.own_rank(), ranks.ranks_on_this_machine()) == (1, 0, 1)
    monkeypatch.setenv(name, "4")
    assert ranks.asked_ranks() == ranks.ranks_on_this_machine() == 4
    monkeypatch.setenv("MPI_LOCALNRANKS", "2")
    assert ranks.ranks_on_this_machine() == 2
    monkeypatch.setenv(name, "nonsense")
    assert ranks.asked_ranks() == 2
