"""The arguments of a simulation that are of another kind than what is expected there."""

from __future__ import annotations

from types import NoneType

import numpy as np

from fcsim.arrays import is_number
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_law.friction import refuse_endless
from fcsim.errors import MODEL, InputError
from fcsim.linkage import Linkage
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.remarks.unlikely import coefficients
from fcsim.timestep.state import State
from fcsim.witness import Witness

_KINDS: dict[str, tuple[type, ...]] = {
    "solver": (SolverSettings,),
    "limits": (Limits,),
    "initial": (State, NoneType),
    "linkage": (Linkage, NoneType),
    "witness": (Witness, NoneType),
}


def refuse_arguments(simulation: object, model: object, detector: object, scheme: object) -> None:
    """InputError where a model, detector or scheme of a simulation is none, or another field none of its kind."""
    if not isinstance(model, Model):
        raise InputError(f"Simulation, model: expected {MODEL}, got {type(model).__name__}")
    if isinstance(detector, type) or not (callable(detector) and hasattr(detector, "nodes")):
        raise InputError(
            "Simulation, detector: expected where bodies may touch, Everything(model, mu=0.5) or Detector([SurfacePair(...)], "
            f"model.n_nodes), got {f'the class {detector.__name__}' if isinstance(detector, type) else type(detector).__name__}"
        )
    _refuse_detector_of_others(detector, model)
    refuse_endless(np.array(coefficients(detector)))
    if isinstance(scheme, type) or not hasattr(scheme, "timing"):
        got = f"the class {scheme.__name__}" if isinstance(scheme, type) else repr(scheme)
        raise InputError(f"Simulation, scheme: expected one as Theta(h=1e-3), QuasiStatic(h=0.1) or GeneralisedAlpha(...), got {got}")
    for name, kinds in _KINDS.items():
        if not isinstance(value := getattr(simulation, name), kinds):
            mend = f": write SolverSettings(name={value!r})" if name == "solver" and isinstance(value, str) else ""
            raise InputError(f"Simulation, {name}: expected {kinds[0].__name__}(...), got {shown(value)}{mend}")


def _refuse_detector_of_others(detector: object, model: Model) -> None:
    """InputError where a detector was made of a model of other bodies, or of the same in another order: its friction, and which facets are
    whose, go by their numbers. One of another placement of the same bodies is as good."""
    while (within := getattr(detector, "detection", None)) is not None:  # what cables and links without contact are put around
        detector = within
    of = getattr(detector, "model", None)
    if not isinstance(of, Model) or of is model:
        return
    theirs, ours = ([(body.name, int(n)) for body, n in zip(m.bodies, np.diff(m.node_offset), strict=True)] for m in (of, model))
    if theirs != ours:
        pairs = enumerate(zip(theirs, ours, strict=False))
        k = next((k for k, (one, other) in pairs if one != other), min(len(theirs), len(ours)))
        one, other = (f"{b[k][0]!r} of {b[k][1]} points" if k < len(b) else "none" for b in (ours, theirs))
        raise InputError(
            f"Simulation, detector: expected one of the simulation's model, got one of another: body {k} is {one}, there {other}"
        )


def whole_number(name: str, value: object, largest: float = float("inf")) -> int:
    """The value, from 0 on, as an int: 10.0 is one as well; InputError for 10.5, -5, "10"."""
    number = float(value) if is_number(value) else -1.0
    if not (number.is_integer() and 0 <= number <= largest):
        span = ">= 0" if largest == float("inf") else f"from 0 to {largest:g}"
        raise InputError(f"{name}: expected a whole number {span}, got {shown(value)}")
    return int(number)
