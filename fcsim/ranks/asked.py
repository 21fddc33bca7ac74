"""What the launcher of MPI says in the environment, without MPI."""

from __future__ import annotations

import os

SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS")
NUMBERS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")
LOCAL_SIZES = ("MPI_LOCALNRANKS", "OMPI_COMM_WORLD_LOCAL_SIZE")


def _largest(names: tuple[str, ...], default: int) -> int:
    return max((int(os.environ[name]) for name in names if os.environ.get(name, "").isdecimal()), default=default)


def asked_ranks() -> int:
    """How many ranks a launcher of MPI has started; 1 without one."""
    return _largest(SIZES, 1)


def own_rank() -> int:
    """This process's number among them; 0 without a launcher."""
    return _largest(NUMBERS, 0)


def ranks_on_this_machine() -> int:
    """How many of them share this machine's memory and cores; all where the launcher does not say."""
    return _largest(LOCAL_SIZES, asked_ranks())
