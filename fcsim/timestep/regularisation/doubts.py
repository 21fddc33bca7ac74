"""What may be why a step did not converge, said with the error."""

from __future__ import annotations

from collections.abc import Iterator

from fcsim.assembly.floating import FAINT, floating, proposed_eta
from fcsim.assembly.model import Model
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme

HIDDEN = 1e-3
"""Of the proposed eta: below it round-off hides the mass of a body that only contact holds."""
PRESSED = 1e-2
"""Of a body's stiffness: an eta / h^2 M that bears what loads of some percent of its modulus do to a body that turns."""


def doubts(model: Model, scheme: Scheme, linked: bool) -> Iterator[str]:
    """Of statics with eta > 0: bodies whose mass is too faint to keep them where they are until contact does.

    linked: there are links, which may hold it.
    """
    if not isinstance(scheme, QuasiStatic) or not scheme.eta or linked:
        return
    loose = [(eta, number) for number in floating(model) if (eta := proposed_eta(model, number, scheme.h)) is not None]
    if loose and scheme.eta < HIDDEN * max(loose)[0]:
        eta, number = max(loose)
        yield (
            f"eta / h^2 M is {FAINT * scheme.eta / eta:.0e} of the stiffness of body {model.bodies[number].name!r}, which only contact "
            f"holds, and round-off hides it: try eta = {eta:.0e}"
        )
    pressed = [(eta, number) for eta, number in loose if any(number in group.members and group.finite for group in model.groups)]
    if pressed and scheme.eta < PRESSED / FAINT * max(pressed)[0]:
        eta, number = max(pressed)
        yield (
            f"where body {model.bodies[number].name!r}, which only contact holds, has lost its stiffness: loads that press it make it "
            f"unstable, and its mass has to bear that until contact does: try eta = {PRESSED / FAINT * eta:.0e} and steps in which "
            "loads stand"
        )
