"""Contact surfaces of a model's bodies, by name."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fcsim.assembly.model import Model
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.errors import InputError


def contact_surface(model: Model, members: Iterable[tuple[str, str]]) -> ContactSurface:
    """Return the union of named surfaces, members (body name, surface name), as one contact surface of the model.

    InputError: an unknown body or surface, or no member at all.
    """
    members = list(members)
    if not members:
        raise InputError("contact_surface: expected at least one (body, surface), got none")
    facets = [model.facets(body, surface) for body, surface in members]
    width = max(f.shape[1] for f in facets)
    padded = [np.pad(f, ((0, 0), (0, width - f.shape[1])), constant_values=-1) for f in facets]
    bodies = np.repeat([model.number[body] for body, _ in members], [len(f) for f in facets])
    return ContactSurface(np.concatenate(padded), bodies)
