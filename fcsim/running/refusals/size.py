"""How large a simulation is, said before its first step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.assembly.over_ranks.pieces import spread_over
from fcsim.memory import free_memory, readable, refuse_beyond_memory
from fcsim.ranks import ranks_on_this_machine, world
from fcsim.timestep.simulation import Simulation

PROGRAM = 200 * 2**20
"""[bytes] Of the libraries."""
PER_DOF = 4.5 * 2**10
"""[bytes] Matrices of the bodies and of the problem, states, files being written."""
PER_OPERATOR = 5.0
"""Copies of the Delassus operator's blocks: the operator, shifted ones, their factors."""
FILL = 25.0
"""Entries of the factor of a part of n degrees of freedom, times n^(4/3)."""


@dataclass(frozen=True)
class Size:
    """Numbers of bodies, degrees of freedom and contacts as the simulation begins, and the memory [bytes] that it will take, about.

    Of a body that ranks have together it is a rank's share. The estimate was compared with walls of 12 to 2565 deformable bricks, of 12
    and 192 rigid ones, and with single parts: it is right within a factor of about two, and for other solvers than the default ones no
    better than that.
    """

    bodies: int
    dofs: int
    contacts: int
    memory: float

    def __str__(self) -> str:
        free = readable(free_memory())
        bodies = "1 body" if self.bodies == 1 else f"{self.bodies} bodies"
        return (
            f"{bodies}, {self.dofs} degrees of freedom, {self.contacts} contacts to begin with: about {readable(self.memory)} "
            f"of memory, {free} are free"
        )

    def refuse(self) -> None:
        """InputError where the simulation does not fit into the memory that is free, see `fcsim.memory`."""
        what = f"{self.bodies} bodies with {self.dofs} degrees of freedom and {self.contacts} contacts to begin with"
        here = 1 if world() is None else ranks_on_this_machine()
        what += f", on each of {here} ranks of this machine" if here > 1 else ""
        refuse_beyond_memory(what, here * self.memory)


def size_of(simulation: Simulation) -> Size:
    """The size of a simulation: W couples the contacts of each body, so that its blocks are the squares of their numbers."""
    model = simulation.model
    x = np.zeros(model.n_dofs) if simulation.initial is None else simulation.initial.x
    together = {key: ranks.size for key, ranks in spread_over(model).items()}  # parts, and how many ranks have them together
    dofs = model.n_dofs - sum((1 - 1 / together.get(id(body.part), 1)) * body.part.points.size for body in model.deformable)
    refuse_beyond_memory(f"{len(model.bodies)} bodies with {model.n_dofs} degrees of freedom", PROGRAM + PER_DOF * dofs)
    contacts = simulation.detector(model.positions(x))
    of_body = np.bincount(contacts.bodies.ravel()[contacts.bodies.ravel() >= 0], minlength=1).astype(np.float64)
    operator = 8.0 * float(np.square(model.dimension * of_body).sum())
    parts = {id(body.part): float(body.part.points.size) for body in model.deformable}
    factors = 8.0 * FILL * sum(n ** (4 / 3) / together.get(key, 1) for key, n in parts.items())
    memory = PROGRAM + PER_DOF * dofs + PER_OPERATOR * operator + factors
    return Size(len(model.bodies), model.n_dofs, len(contacts), memory)
