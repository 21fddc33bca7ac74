"""What is said of one step, each kind once in a run."""

from __future__ import annotations

from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.contact_detection import Detection
from fcsim.timestep.limits import remarks
from fcsim.timestep.regularisation.out_of_balance import out_of_balance
from fcsim.timestep.regularisation.scarce_digits import scarce_digits
from fcsim.timestep.remarks.bearing_nothing import bearing_nothing
from fcsim.timestep.remarks.coarse import coarse
from fcsim.timestep.remarks.dented import dented
from fcsim.timestep.remarks.driven_parts import driven_parts
from fcsim.timestep.remarks.equilibria.buckled import Buckled
from fcsim.timestep.remarks.equilibria.snapping import Snapping
from fcsim.timestep.remarks.lumped_inertia import LumpedInertia
from fcsim.timestep.remarks.of_laws.carried_round import CarriedRound
from fcsim.timestep.remarks.of_laws.coarse_springs import coarse_springs
from fcsim.timestep.remarks.of_laws.rigid_joints import rigid_joints
from fcsim.timestep.remarks.of_laws.rolled_on import RolledOn
from fcsim.timestep.remarks.of_laws.struck_together import struck_together
from fcsim.timestep.remarks.of_laws.turned_joints import turned_joints
from fcsim.timestep.remarks.of_laws.turned_slip import turned_slip
from fcsim.timestep.remarks.of_shapes.chords import Chords
from fcsim.timestep.remarks.of_shapes.corners import Corners
from fcsim.timestep.remarks.of_shapes.entered import Entered
from fcsim.timestep.remarks.of_shapes.far_off import far_off
from fcsim.timestep.remarks.of_shapes.few_facets import FewFacets
from fcsim.timestep.remarks.of_shapes.other_sides import OtherSides
from fcsim.timestep.remarks.of_shapes.raised import Raised
from fcsim.timestep.remarks.of_shapes.sunk_edges import SunkEdges
from fcsim.timestep.remarks.spinning import spinning
from fcsim.timestep.step import Step


class StepRemarks:
    """What is said of the steps of a run, in turn; detection: what finds its contacts; steps: how many it has."""

    def __init__(self, detection: Detection, steps: int) -> None:
        self._detection, self._steps, self._snapping, self._inertia = detection, steps, Snapping(), LumpedInertia()
        self._buckled, self._carried, self._chords = Buckled(), CarriedRound(), Chords(detection, steps)
        self._rolled, self._few = RolledOn(), FewFacets(detection, steps)
        self._corners, self._entered = Corners(), Entered(detection, steps)
        self._sunk, self._raised = SunkEdges(detection, steps), Raised(steps)
        self._other_sides = OtherSides(detection)

    def __call__(self, step: Step, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
        """Remarks by kind, of those kinds that are not among the `said`."""
        own = remarks(step.model, found, when, said) | self._snapping(step, when, said) | self._inertia(step, found, when, said)
        own |= out_of_balance(step, self._steps, when, said) | self._buckled(step, found, self._steps, when, said)
        return (
            own
            | spinning(step, self._detection, when, said)
            | coarse(step, found, self._steps, when, said)
            | dented(step, self._detection, self._steps, when, said)
            | driven_parts(step, when, said)
            | bearing_nothing(step, self._detection, when, said)
            | struck_together(step, when, said)
            | turned_slip(step, when, said)
            | turned_joints(step, when, said)
            | rigid_joints(step, when, said)
            | coarse_springs(step, when, said)
            | self._rolled(step, found, when, said)
            | self._carried(step, found, when, said)
            | self._chords(step, when, said)
            | self._few(step, when, said)
            | self._corners(step, found, when, said)
            | self._entered(step, when, said)
            | self._sunk(step, when, said)
            | self._raised(step, when, said)
            | self._other_sides(step, when, said)
            | far_off(step, self._steps, when, said)
            | scarce_digits(step, when, said)
        )
