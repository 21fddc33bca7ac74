"""Stretches that are carried along by bodies that turn, and the rotations of bodies, against rotations themselves."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim import build_model
from fcsim.contact_law.proportions import proportions
from fcsim.contact_law.turning_along import attitudes, carried
from fcsim.mesh import Body, Material, brick, rigid_box, rigid_rectangle, rigid_sphere


class Met:
    """What the functions ask of a `Meeting` of one contact."""

    def __init__(self, contacts: Any, about: Any, positions: Any) -> None:
        self.contacts, self.proportions, self.positions = contacts, about, positions

    def __len__(self) -> int:
        return 1

    def in_frame(self, vectors: Any) -> Any:
        return np.einsum("aij,aj->ai", self.contacts.frame, vectors)


def frame_of(normal: Any) -> Any:
    """A right-handed frame whose T1 jumps with the largest component of the normal, as those of detection may."""
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    one = np.cross(axis, normal)
    one /= np.linalg.norm(one)
    return np.stack([normal, one, np.cross(normal, one)])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [(1.0, 1.0), (1.0, 0.0)])
def test_a_stretch_turns_by_the_mean_of_both_bodies_spins(seed: int, share: tuple[float, float]) -> None:
    """Bodies that turn alike by any rotation take the stretch along; where one stands still a turn about the normal takes half."""
    rng = np.random.default_rng(seed)
    soft = brick("p", (0.2, 0.1, 0.1), (2, 1, 1), Material(1e7, 0.3, 1e3))
    model = build_model([Body("soft", soft), rigid_sphere("ball", 0.1, (0, 0, 1.0), 1.0)])
    about = proportions(model)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    alike = share[0] == share[1]
    turn = rng.normal(size=3) if alike else 1.4 * normal
    stretch = np.cross(normal, rng.normal(size=3))
    errors = []
    for parts in (20, 40, 80):
        e, before = stretch[None], np.full((1, 6), np.nan)
        for k in range(parts + 1):
            turned = [Rotation.from_rotvec(s * k / parts * turn) for s in share]
            first = model.node_offset
            at = np.concatenate([turned[b].apply(model.reference[first[b] : first[b + 1]]) + rng.normal(size=3) for b in (0, 1)])
            frame = frame_of(turned[0].apply(normal))[None]
            meeting: Any = Met(SimpleNamespace(dimension=3, frame=frame, bodies=np.array([[0, 1]])), about, at)
            along = carried(meeting, e, before)
            assert np.linalg.norm(along) == pytest.approx(np.linalg.norm(stretch), rel=1e-9)
            e, before = np.einsum("aij,ai->aj", frame[:, 1:], along), attitudes(meeting)
        expected = Rotation.from_rotvec((1.0 if alike else 0.5) * turn).apply(stretch)
        errors.append(float(np.linalg.norm(e[0] - expected) / np.linalg.norm(stretch)))
    assert errors[-1] < 1e-9 if not alike else errors[-1] < 0.02 and errors[-1] < 0.6 * errors[0]


def test_rotations_of_bodies_that_have_turned() -> None:
    """R to round-off of bodies in the plane and in space, moved far, also of one whose points lie in a plane."""
    flat = rigid_box("flat", size=(1.0, 1.0, 0.1), centre=(0, 0, 0), mass=1.0)
    rng = np.random.default_rng(3)
    for bodies in (
        [flat, rigid_sphere("ball", 0.1, (0, 0, 1), 1.0)],
        [rigid_rectangle("a", (1, 2), (0, 0), 1.0), rigid_sphere("b", 1, (0, 5), 1.0)],
    ):
        model = build_model(bodies)
        d = model.dimension
        true = np.linalg.qr(rng.normal(size=(2, d, d)))[0]
        true[:, :, 0] *= np.linalg.det(true)[:, None]
        about = proportions(model)
        owner = np.repeat([0, 1], np.diff(np.append(about.first, model.n_nodes)))
        moved = np.einsum("nij,nj->ni", true[owner], model.reference) + 1e3
        assert about.rotations(moved) == pytest.approx(true, abs=1e-10)


def test_a_new_face_does_not_keep_the_stretch_and_an_unknown_one_has_none() -> None:
    """In 2D: along the old normal nothing is left; of a frame that turned by a little the length stays."""
    for angle, kept in ((0.1, 1.0), (np.pi / 2, 0.0)):
        c, s = np.cos(angle), np.sin(angle)
        frame = np.array([[[-s, c], [c, s]]])
        meeting: Any = Met(SimpleNamespace(dimension=2, frame=frame), None, None)
        assert carried(meeting, np.array([[1e-3, 0.0]]), np.full((1, 6), np.nan)) == pytest.approx(kept * 1e-3, abs=1e-15)
        assert carried(meeting, np.zeros((1, 2)), np.full((1, 6), np.nan)) == pytest.approx(0.0)
