"""Contacts between parts that supports hold or drive: no part of the problem, refused where they are driven into each other."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Compliant, Springs
from fcsim.errors import InputError
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta

E = 1e6
ANY = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)


def pair(model: Model, mu: float, **options: Any) -> Detector:
    slave, master = (contact_surface(model, [of]) for of in (("block", "y-"), ("plate", "y+")))
    return Detector([SurfacePair(slave, master, mu, 0.05, **options)], model.n_nodes)


def on_a_plate(law: Any, held: list[Support], gap: float = 0.0, **more: Any) -> Model:
    """A unit square with nu = 0 on a clamped plate, its bottom `gap` above it."""
    block = Body("block", rectangle("block", (1.0, 1.0), (4, 4), law(E, 0.0, 1.0)))
    plate = rigid_rectangle("plate", (2.0, 0.5), (0.5, -0.25 - gap), 1.0)
    return build_model([block, plate], supports=[Support("plate", ("x", "y", "rz")), *held], **more)


@pytest.mark.each_value
@pytest.mark.parametrize("law", [Material, neo_hooke])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("gap", [0.0, -1e-9])
@pytest.mark.parametrize("rule", ["nodes", "mortar", "everything"])
def test_of_a_bottom_that_is_held_in_part(law: Any, mu: float, gap: float, rule: str) -> None:
    """Nodes of the bottom are held along the normal and touch too: uniform pressure reaches the plate or the support at each."""
    corner = Support("block", ("x", "y"), at=(0.0, 0.0))
    model = on_a_plate(
        law, [corner, Support("block", ("y",), at=(0.25, 0.0))], gap, loads=[Traction("block", "y+", (0.0, -1e3), lambda t: t)]
    )
    detection = Everything(model, mu) if rule == "everything" else pair(model, mu, candidates=rule)
    (step,) = Simulation(model, detection, QuasiStatic(1.0), 1, limits=ANY)
    assert 0 < len(step.contacts) == step.problem.nc < (4 if rule == "nodes" else 9)
    supports = step.support_impulse[: model.n_elastic].reshape(-1, 2).sum(axis=0)
    # neo-Hooke's dead pressure acts on the reference area; the overlap at the start moves what is free by 1e-9
    assert_allclose(step.contact_force_on(model.number["block"])[1] + supports[1], 1e3, rtol=1e-9)
    if mu == 0 and rule == "nodes":
        assert_allclose(supports[1], 1e3 * (0.125 + 0.25), rtol=1e-2)  # weights of both nodes in uniform pressure
    assert [remark for remark in step.remarks if "touch at" in remark and "is not determined" in remark]


@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("scheme", [QuasiStatic(1.0), Theta(0.1)])
def test_parts_that_move_together_press_nothing_that_is_known(rigid: bool, scheme: Any) -> None:
    """All nodes of a face are driven with the plate: the problem is one without contacts, the force on the block is E strain A."""
    law, down = Material(E, 0.0, 1.0), -1e-3
    held = [Support("block", ("x", "y"), "y+"), Support("block", ("x",), "y-"), Support("block", ("y",), "y-", velocity=-down)]
    plate: Any = rigid_rectangle("plate", (2.0, 0.5), (0.5, -0.25), 1.0)
    stuck = [Support("plate", ("x", "rz")), Support("plate", ("y",), velocity=-down)]
    if not rigid:
        plate = Body("plate", rectangle("plate", (2.0, 0.5), (3, 1), law), translation=(-0.5, -0.5))
        stuck = [Support("plate", ("x",)), Support("plate", ("y",), velocity=-down)]
    block = Body("block", rectangle("block", (1.0, 1.0), (4, 4), law))
    model = build_model([block, plate], supports=[*held, *stuck])
    *_, last = Simulation(model, pair(model, 0.5), scheme, 3)
    assert last.problem.nc == 0 and last.encounter.driven is not None and len(last.encounter.driven.contacts) == 5
    if isinstance(scheme, QuasiStatic):
        bottom = np.unique(model.facets("block", "y-"))
        assert_allclose(last.support_impulse[model.dof_of_node[bottom, 1]].sum(), E * 3e-3, rtol=1e-9)


@pytest.mark.parametrize(("scheme", "steps"), [(QuasiStatic(1.0), 4), (Theta(0.01), 40)])
@pytest.mark.parametrize("law", [Material, neo_hooke])
def test_parts_driven_into_each_other_are_refused(scheme: Any, steps: int, law: Any) -> None:
    """The bottom goes down by 5e-3 a second onto a plate that lies 1e-3 below: more than a thousandth of the plate in each other."""
    held = [Support("block", ("x",), "y-"), Support("block", ("y",), "y-", velocity=-5e-3)]
    model = on_a_plate(law, held, 1e-3)
    with pytest.raises(InputError, match=r"step \d+, t = .* supports drive 'block' and 'plate' 0\.0\d+ m into each other at \("):
        list(Simulation(model, pair(model, 0.3), scheme, steps, limits=ANY, witness=None))


def test_of_a_wheel_on_a_pivot() -> None:
    """A rigid square that its middle alone holds turns freely: its face above the middle moves along a clamped node's tangent, not along
    its normal; beside the middle it turns away, and nothing holds it there."""
    wheel = rigid_rectangle("plate", (2.0, 0.5), (0.5, -0.25), 1.0)
    block = Body("block", rectangle("block", (1.0, 1.0), (2, 2), Material(E, 0.0, 1.0)))
    model = build_model([block, wheel], supports=[Support("plate", ("x", "y")), Support("block", ("x", "y"))])
    (step,) = Simulation(model, pair(model, 0.3), Theta(1e-3), 1)
    assert step.encounter.driven is not None
    assert_allclose(step.encounter.driven.contacts.point, [[0.5, 0.0]])
    assert step.problem.nc == 2


def test_of_supports_along_other_axes() -> None:
    """A bottom held along its own normal on a slope slides on the parallel plate; what it presses is the support's."""
    angle = 0.4
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    block = Body("block", rectangle("block", (1.0, 1.0), (2, 2), Material(E, 0.0, 1.0)), rotation=axes)
    plate = Body(
        "plate", rectangle("plate", (2.0, 0.5), (1, 1), Material(E, 0.0, 1.0)), rotation=axes, translation=tuple(axes @ (-0.5, -0.5))
    )
    supports = [
        Support("plate", ("x", "y")),
        Support("block", ("y",), "y-", axes=axes),
        Support("block", ("x",), "x-", axes=axes),
    ]
    model = build_model([block, plate], supports=supports, loads=[Traction("block", "y+", tuple(axes @ (0.0, -1e3)), lambda t: t)])
    (step,) = Simulation(model, pair(model, 0.3), QuasiStatic(1.0), 1)
    assert step.problem.nc == 0
    held = step.support_impulse[: model.n_elastic].reshape(-1, 2)[np.unique(model.facets("block", "y-"))].sum(axis=0)
    assert_allclose(axes.T @ held, [0.0, 1e3], atol=1e-6)


def test_joints_with_a_stiffness_keep_their_force() -> None:
    """Springs between plates that are driven towards each other: k d A, known though nothing is free."""
    held = [Support("block", ("x",)), Support("block", ("y",), velocity=-1e-4)]
    model = on_a_plate(Material, held)
    (step,) = Simulation(model, pair(model, 0.3), QuasiStatic(1.0, law=Compliant(Springs(normal=1e7, tangential=1e7))), 1)
    assert step.encounter.driven is None
    assert_allclose(step.contact_force_on(model.number["block"]), [0.0, 1e7 * 1e-4], rtol=1e-9, atol=1e-6)
