"""What a model finds once and keeps, of all nodes or degrees of freedom, in memory that ranks have in common."""

from __future__ import annotations

from fcsim.assembly.model import Model
from fcsim.ranks import held_in_common


def keep_in_common(model: Model) -> None:
    """Have ranks of one machine keep these arrays once. All ranks must ask, before others keep them as well."""
    if model.shares is None:
        return
    kept, (place, count) = vars(model), model.place_of_unknowns
    kept["place_of_unknowns"] = held_in_common(place), count
    for name in ("reference", "dof_of_node", "free_dofs", "weight_of_units"):
        kept[name] = held_in_common(getattr(model, name))
    for group in model.groups:
        vars(group)["dofs"] = held_in_common(group.dofs)
