"""What is said of bodies that turn with a lumped mass: on coarse meshes it has too large a moment of inertia, and they fall late."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.elasticity import consistent_mass
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.assembly.model import Model
from fcsim.timestep.step import Step

NAMED = 0.05
"""Excess of the moment of inertia, over the body's own, from which it is named."""
TURNED = np.radians(2.0)
"""[rad] Rotation from which a body counts as one that turns."""


class LumpedInertia:
    """The remark on the body that has turned furthest, of those whose lumped mass has too large a moment of inertia about the axis of its
    rotation: call it with the steps in turn.

    With S_k = sum m_i (X_i - c)(X_i - c)^T of the masses m_i [kg] on the nodes, S = sum M_ij (X_i - c)(X_j - c)^T of the consistent ones,
    which is the integral over the cells, and the axis a, the excess is (tr S_k - a . S_k a) / (tr S - a . S a) - 1; of a brick of n cells
    along its side L the share of this side, m L^2 / 12, is multiplied by 1 + 2 / n^2. In statics mass moves nothing. Bodies whose
    operators ranks have together are not asked.
    """

    def __init__(self) -> None:
        self._groups: list[tuple[Group, FloatArray, FloatArray]] | None = None

    def __call__(self, step: Step, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark by its kind; {} where there is none, or where it is `said`."""
        if "lumped inertia" in said or not step.scheme.timing.moving or not found.rotation.max(initial=0.0) > TURNED:
            return {}
        if self._groups is None:
            self._groups = _too_large(step.model)
        worst: tuple[float, int, float] = (TURNED, -1, 0.0)
        for group, lumped, own in self._groups:
            number = int(group.members[found.rotation[group.members].argmax()])
            if found.rotation[number] > worst[0]:
                axis = _axis(step, number)
                excess = float((axis @ lumped @ axis) / (axis @ own @ axis)) - 1
                worst = (float(found.rotation[number]), number, excess) if excess > NAMED else worst
        angle, number, excess = worst
        if number < 0:
            return {}
        return {
            "lumped inertia": f"{when}: body {step.model.deformable[number].name!r} has turned by {np.degrees(angle):.3g} degrees, and its "
            f"lumped mass has a moment of inertia {100 * excess:.3g} % larger than its own: it turns and falls too slowly. "
            "build_model(lumped=False) has no such error, smaller cells a smaller one"
        }


def _too_large(model: Model) -> list[tuple[Group, FloatArray, FloatArray]]:
    """Groups of bodies that can turn whose lumped mass is beyond `NAMED` about some axis, with both moments of inertia in world axes
    (3, 3), in 2D (1, 1) [kg m^2]."""
    found = []
    for group in model.groups:
        if group.lumped is None or group.over_ranks or not group.rotates or not np.any(group.lumped):
            continue
        d = len(group.rotation)
        mass = group.lumped.reshape(-1, d)[:, 0]
        arm = (group.part.points - mass @ group.part.points / mass.sum()) @ group.rotation.T
        lumped = _inertia(np.einsum("i,ij,ik->jk", mass, arm, arm))
        own = _inertia(arm.T @ (consistent_mass(group.part)[::d, ::d] @ arm))
        if np.linalg.eigvals(np.linalg.solve(own, lumped)).real.max() > 1 + NAMED:
            found.append((group, lumped, own))
    return found


def _inertia(S: FloatArray) -> FloatArray:
    """tr(S) I - S (3, 3), in 2D tr(S) (1, 1) [kg m^2], of the second moments S (d, d)."""
    return np.array([[np.trace(S)]]) if len(S) == 2 else np.trace(S) * np.eye(3) - S


def _axis(step: Step, number: int) -> FloatArray:
    """The axis (3,) about which a deformable body has turned; 2D: (1,)."""
    model = step.model
    if model.dimension == 2:
        return np.ones(1)
    nodes = slice(int(model.node_offset[number]), int(model.node_offset[number + 1]))
    X, x = model.reference[nodes], model.positions(step.state.x)[nodes]
    U, _, Vt = np.linalg.svd((x - x.mean(axis=0)).T @ (X - X.mean(axis=0)))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    values, vectors = np.linalg.eigh(R + R.T)  # the axis has the largest value, 2; the others have 2 cos of the angle
    axis: FloatArray = vectors[:, values.argmax()]
    return axis
