"""What is said as a run begins of friction that changes with what slides, where contacts do not live as long as that takes."""

from __future__ import annotations

from collections.abc import Iterator

from fcsim.contact_detection import Detection, Detector
from fcsim.contact_law import RateDependent, SlipWeakening, StaticKinetic
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.scheme import Scheme


def slid_over_facets(detector: Detection, scheme: Scheme) -> Iterator[str]:
    """The remark on friction by the way slid, in statics by the rate too, at points of "segments": each is of a slave's and a master's
    facet, and what comes to the next facet is another one, which has not slid yet."""
    if not (isinstance(detector, Detector) and any(pair.candidates == "segments" for pair in detector.pairs)):
        return
    remembered = SlipWeakening if scheme.timing.moving else SlipWeakening | StaticKinetic | RateDependent
    frictions = (getattr(law, "friction", None) for law in single_laws(scheme.law))
    named = next((type(friction).__name__ for friction in frictions if isinstance(friction, remembered)), None)
    if named:
        yield (
            f'{named} at points of candidates="segments": each belongs to one facet of either surface, and what slides to the next facet '
            'has its friction at rest again, so that there is too much of it. What helps: candidates="mortar", "faces" or "nodes"'
        )
