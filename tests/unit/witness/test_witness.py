"""The witness in a simulation: bad starts are named and refused, penetration that detection misses ends a run, press fits run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fcsim import (
    Body,
    Detector,
    Everything,
    ExactContacts,
    Gap,
    InputError,
    Material,
    Model,
    RigidBody,
    Simulation,
    Support,
    SurfacePair,
    Theta,
    Velocity,
    Witness,
    at_rest,
    build_model,
    contact_surface,
    without_contact_of,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.errors import Penetration
from fcsim.mesh import Part, brick, rigid_box, rigid_capsule

STONE = Material(1e9, 0.2, 2000.0)


def block_above(model: Model) -> SurfacePair:
    return SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), mu=0.5, alert=1e-2)


def simulation(gap: float, steps: int = 3, witness: Witness | None = None, side: str = "z+") -> Simulation:
    """A cube of 0.2 m above a held floor by `gap`; contact with the floor's `side` alone."""
    floor = rigid_box("floor", (2.0, 2.0, 0.5), (0.0, 0.0, -0.25), 1.0)
    block = rigid_box("block", (0.2, 0.2, 0.2), (0.0, 0.0, 0.1 + gap), 10.0)
    model = build_model([floor, block], supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: np.array([0.0, 0.0, -9.81]))
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", side)]), mu=0.5, alert=1e-2)
    return Simulation(model, Detector([pair], model.n_nodes), Theta(1e-2, 0.5, Gap()), steps, witness=witness or Witness())


def test_a_block_in_the_floor_is_named_with_its_depth() -> None:
    with pytest.raises(InputError, match=r"'floor' and 'block' by 0\.1 m \(50 % .*initial='allow'"):
        list(simulation(-0.1))


def test_what_is_allowed_runs_and_may_not_grow() -> None:
    """2 cm of overlap in a floor whose top is no surface of contact: allowed at first, but not to deepen."""
    bodies_fall = simulation(-0.02, steps=40, witness=Witness(initial="allow", every=1), side="x+")
    seen = []
    with pytest.raises(Penetration, match=r"penetration seen after step .* between 'floor' and 'block'"):
        for step in bodies_fall:
            assert step.overlap is not None
            seen.append((step.overlap.depth, 0.5 * 9.81 * step.state.t**2))
    assert all(depth == pytest.approx(0.02 + fallen, rel=1e-9) for depth, fallen in seen)  # free fall
    assert seen[-1][1] > 0.02 * 0.2 >= seen[-2][1]  # stopped at the first step that exceeds what it began with by 2 % of the block


def test_a_wrong_face_is_seen() -> None:
    """With the floor's lower face named as the one to stand on the block falls into it."""
    run = simulation(0.0, steps=200, side="z-")
    with pytest.raises(Penetration, match="Contacts were missed"):
        list(run)


def test_overlap_of_a_step_s_way_under_the_law_velocity_names_the_step() -> None:
    """A cube that comes at 1 m/s goes 1 cm a step, 5 % of it, and is held as deep as that takes it."""
    fall = simulation(0.006)
    start = at_rest(fall.model)
    start.v[fall.model.dof_offset[1] + 2] = -1.0
    run = replace(fall, scheme=Theta(1e-2, 0.5, Velocity()), initial=start, witness=Witness(every=1))
    with pytest.raises(Penetration, match="The law Velocity lets in what approaches by up to its way in a step"):
        list(run)


def test_the_witness_may_only_record_or_be_absent() -> None:
    recorded = list(simulation(0.0, steps=20, side="z-", witness=Witness(stop=False)))
    assert recorded[-1].overlap is not None
    assert recorded[-1].overlap.beyond
    assert recorded[-2].overlap is None
    assert recorded[9].overlap is not None
    alone = simulation(-0.1, steps=1)
    unwatched = Simulation(alone.model, alone.detector, alone.scheme, 1, witness=None, created=np.inf)
    assert next(iter(unwatched)).overlap is None
    assert "overlap of bodies is not witnessed" in unwatched.notes


def test_a_block_at_rest_does_not_overlap() -> None:
    last = list(simulation(0.0, steps=20))[-1]
    assert last.overlap is not None
    assert last.overlap.depth == 0.0


def test_coincident_and_inner_bodies_are_refused() -> None:
    part = brick("brick", (0.2, 0.1, 0.1), (2, 1, 1), STONE)
    floor = rigid_box("floor", (2.0, 2.0, 0.5), (0.0, 0.0, -0.25), 1.0)
    for other in (
        Body("twin", part),
        rigid_box("twin", (0.02, 0.02, 0.02), (0.1, 0.05, 0.05), 1.0),
        Body("twin", part, translation=np.array([0.1, 0.0, 0.0])),
    ):
        model = build_model([Body("brick", part), other, floor], supports=[Support("floor", DIRECTIONS[3])])
        bed = SurfacePair(contact_surface(model, [("brick", "z-")]), contact_surface(model, [("floor", "z+")]), mu=0.5, alert=1e-3)
        with pytest.raises(InputError, match="'brick' and 'twin' by"):
            list(Simulation(model, Detector([bed], model.n_nodes), Theta(1e-3, 0.5, Gap()), 1))


def test_inside_out_surfaces_are_refused() -> None:
    good = rigid_box("block", (0.2, 0.2, 0.2), (0.0, 0.0, 0.1), 10.0)
    bad = RigidBody("block", 10.0, good.inertia, good.centre, good.points, {k: f[:, ::-1] for k, f in good.surfaces.items()})
    floor = rigid_box("floor", (2.0, 2.0, 0.5), (0.0, 0.0, -0.25), 1.0)
    model = build_model([floor, bad])
    with pytest.raises(InputError, match=r"body 'block'.*inside out"):
        list(Simulation(model, Detector([block_above(model)], model.n_nodes), Theta(1e-2, 0.5, Gap()), 1))
    part = brick("brick", (0.2, 0.2, 0.2), (1, 1, 1), STONE)
    turned = Part("brick", part.points, part.cells, part.cell_type, {"z-": part.surfaces["z-"][:, ::-1]}, STONE)
    model = build_model([Body("block", turned), floor])
    with pytest.raises(InputError, match=r"'block', surface 'z-'.*inside out"):
        list(Simulation(model, Detector([block_above(model)], model.n_nodes), Theta(1e-2, 0.5, Gap()), 1))


def test_open_surfaces_are_noted() -> None:
    full = rigid_box("floor", (2.0, 2.0, 0.5), (0.0, 0.0, -0.25), 1.0)
    sheet = RigidBody("floor", 1.0, full.inertia, full.centre, full.points, {"z+": full.surfaces["z+"]})
    block = rigid_box("block", (0.2, 0.2, 0.2), (0.0, 0.0, 0.1), 10.0)
    model = build_model([sheet, block], supports=[Support("floor", DIRECTIONS[3])])
    run = Simulation(model, Detector([block_above(model)], model.n_nodes), Theta(1e-2, 0.5, Gap()), 1)
    assert list(run)[-1].overlap is not None
    assert any("not witnessed at 'floor'" in note for note in run.notes)


@pytest.mark.parametrize("wrong", [{"every": 0}, {"every": 2.5}, {"tolerance": 0.0}, {"tolerance": np.nan}, {"initial": "yes"}])
def test_bad_settings_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=f"Witness, {next(iter(wrong))}: expected"):
        Witness(**wrong)  # type: ignore[arg-type]


def test_bodies_whose_contact_is_left_out_may_lie_in_each_other() -> None:
    """Capsules of a chain that share an end overlap by their radius, in each other's ball of 2 cm: by how a detection is told, not by
    which; what is not told is still refused."""
    places = (0.0, 0.1, 0.2)
    links = [rigid_capsule(f"link {k}", 0.02, 0.1, (x, 0.0, 0.0), 1.0, axis=(1, 0, 0)) for k, x in enumerate(places)]
    model = build_model(links)
    pairs = [("link 0", "link 1"), ("link 2", "link 1")]
    told = ExactContacts(model, 0.0, exclude=pairs)
    for detector in (told, without_contact_of(ExactContacts(model, 0.0, exclude=pairs[:1]), model, pairs[1:])):
        run = Simulation(model, detector, Theta(1e-3), 1)
        (step,) = run
        assert step.overlap is not None and step.overlap.bodies is None
        assert run.notes[-1].endswith("not witnessed between 'link 0' and 'link 1', 'link 1' and 'link 2': their contact is left out")
    with pytest.raises(InputError, match="'link 1' and 'link 2' by"):
        list(Simulation(model, ExactContacts(model, 0.0, exclude=pairs[:1]), Theta(1e-3), 1))


def test_meshed_bodies_whose_contact_is_left_out_may_lie_in_each_other() -> None:
    model = build_model([rigid_box(name, (0.2, 0.2, 0.2), (x, 0, 0), 1.0) for name, x in (("c", 0.0), ("b", 0.1), ("a", 0.25))])
    with pytest.raises(InputError, match="'c' and 'b' by") as refused:
        list(Simulation(model, Everything(model, 0.0, exclude=[("a", "b")]), Theta(1e-3), 1))
    assert "'a'" not in str(refused.value)
