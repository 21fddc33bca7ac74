"""What is said of pairs of surfaces whose slave is too coarse: the master's nodes go into it between the slave's points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.contact_detection import Contacts, Detection, Detector, SurfacePair
from fcsim.contact_detection.detection import innermost
from fcsim.contact_detection.sweep import brought_back
from fcsim.ranks import shared_out
from fcsim.timestep.remarks.coarse import looked_at
from fcsim.timestep.step import Step

_POINTWISE = ("nodes", "faces", "gauss")
NAMED = 0.06
"""Of how far the bodies are deformed: surfaces that lie in each other by more, in the mean, are named. It is about the share by which the
bodies give way too much. Blocks on blocks in the plane: 0.002 where the slave's facets are as long as the master's or shorter, 0.05 where
twice as long (5.9 % too soft), 0.07 five times (8.2 %), 0.46 fifty times (87 %)."""
SEEN = 1e-9
"""Of the smaller body's size: less depth than this is round-off."""
_LONG = 16  # steps of dynamics over which energy and forces are taken together


class Deformed:
    """How far contacts deform bodies [m]: twice the elastic energy over the sum of their forces' amounts (joints draw, too).

    In dynamics forces act on bodies not deformed yet or swinging back: energy and forces are those of all steps so far there (at rest in
    the mean, as the virial theorem has it), from step 16 on.
    """

    def __init__(self, steps: int) -> None:
        self._steps, self._energy, self._force = steps, 0.0, 0.0

    def __call__(self, step: Step) -> float | None:
        """None where nothing presses, and in steps that are not looked at: but 1, 4, 16, ... and the last. To be asked in every step."""
        force, moving = step.contact_force[:, 0], step.scheme.timing.moving
        before = (self._energy, self._force) if moving else (0.0, 0.0)
        self._energy, self._force = before[0] + step.energy.elastic, before[1] + float(np.abs(force).sum())
        looked = looked_at(step.number) or step.number == self._steps
        if not looked or (moving and step.number < _LONG) or not (force > 0).any():
            return None
        return 2.0 * self._energy / self._force


class Entered:
    """The remark on the first pair of surfaces in one pass whose master's nodes lie within the slave where that bears, in the mean over
    them by more than `NAMED` of how far the contacts deform bodies (`Deformed`): the slave's few points bear what should be spread. The
    same pairs the other way round are the measure.
    """

    def __init__(self, detection: Detection, steps: int) -> None:
        self._detection, self._deformed = innermost(detection), Deformed(steps)

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark, {} where there is none."""
        model, detection = step.model, self._detection
        if "entered" in said or not model.deformable or not isinstance(detection, Detector):
            return {}
        motion = self._deformed(step)
        if motion is None:
            return {}
        force, size = step.contact_force[:, 0], step.encounter.meeting.proportions.size
        contacts, x = step.contacts, model.positions(step.state.x)
        bears = np.zeros(model.n_nodes, dtype=bool)
        real = (contacts.nodes >= 0) & (force > 0)[:, None]
        bears[contacts.nodes[real]] = True
        pointwise = [(number, pair) for number, pair in enumerate(detection.pairs) if pair.candidates in _POINTWISE]
        bearing = brought_back(contacts.take(force > 0), x)
        looks = [(1, partial(_depth, detection, pair, x, bears, bearing)) for _, pair in pointwise]
        for (number, pair), (depth,) in zip(pointwise, _by_size(looks, [pair for _, pair in pointwise]), strict=True):
            least = SEEN * float(size[np.unique(np.concatenate([pair.slave.bodies, pair.master.bodies]))].min())
            if depth > max(NAMED * motion, least):
                one, other = (model.bodies[int(surface.bodies[0])].name for surface in (pair.slave, pair.master))
                called = repr(pair.name) if pair.name else str(number + 1)
                return {
                    "entered": f"{when}: pair {called} (slave {one!r}, master {other!r}): nodes of the master lie {depth:.2g} m deep in "
                    f"the slave between its points, in the mean, beside {motion:.2g} m by which contact deforms the bodies: a few points "
                    'bear what the surfaces should. What helps: the finer surface as slave, candidates="mortar", or Everything'
                }
        return {}


def _depth(detection: Detector, pair: SurfacePair, x: FloatArray, bears: BoolArray, bearing: Contacts) -> FloatArray:
    """How much deeper [m] than the contacts that are `bearing` the master's nodes lie in the slave where that `bears` (nodes,), in the mean
    (1,); x (nodes, d) [m]."""
    back = SurfacePair(pair.master, pair.slave, 0.0, pair.alert, "nodes", normals=pair.normals)
    there = Detector([back], detection.n_nodes, detection.edge_tolerance, detection.penetration)(x)
    under = there.take((bears[there.nodes] & (there.nodes >= 0) & (there.weights < 0)).any(axis=1))
    own = np.isin(bearing.bodies[:, 0], pair.slave.bodies) & np.isin(bearing.bodies[:, 1], pair.master.bodies)
    meant = np.maximum(-bearing.gap[own], 0.0).mean() if own.any() else 0.0
    return np.array([max(np.maximum(-under.gap, 0.0).mean() - meant, 0.0) if len(under) else 0.0])


def _by_size(looks: Sequence[tuple[int, Callable[[], FloatArray]]], pairs: Sequence[SurfacePair]) -> list[FloatArray]:
    """What looks at pairs find, each pair by one rank: the largest first, so that each rank has as much to do."""
    order = np.argsort([-len(pair.slave.facets) - len(pair.master.facets) for pair in pairs], kind="stable").tolist()
    found = shared_out("masters' nodes within slaves", [looks[k] for k in order])
    return [depth for _, depth in sorted(zip(order, found, strict=True), key=lambda both: both[0])]
