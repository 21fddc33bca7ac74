"""What is said of a simulation that begins from a state of another: laws that remember begin anew."""

from __future__ import annotations

from collections.abc import Iterator

from fcsim.contact_law import Cohesive, Compliant, SlipWeakening
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

_ANEW = {
    Cohesive: "joints that have cracked hold again",
    Compliant: "tangential springs begin without stretch",
    SlipWeakening: "friction begins at its static value",
}


def begun_anew(scheme: Scheme, state: State) -> Iterator[str]:
    """The remark where a run begins later than t = 0 with bodies moved, under a law that remembers more than a `State` has."""
    if not (state.t > 0 and state.x.any()):
        return
    laws = list(single_laws(scheme.law))
    laws += [getattr(law, "friction", None) for law in laws]
    anew = [said for kind, said in _ANEW.items() if any(isinstance(law, kind) for law in laws)]
    if anew:
        yield (
            f"this run begins from a state at t = {state.t:.6g} s, which has not what the contact law remembers: {'; '.join(anew)}. To go "
            "on with a run take simulation.run(step.moment), with steps counted from its beginning"
        )
