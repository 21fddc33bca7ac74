"""Load steps of statics: exact bars, regularised floating bodies, refusals."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Force, Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Rolling, Velocity
from fcsim.contact_law.law import Law
from fcsim.errors import FcsimError, InputError, NotConverged
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.regularisation.doubts import doubts
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step

SOFT = Material(1e6, 0.3, 1000.0)
HELD = Support("plane", ("x", "y", "z", "rx", "ry", "rz"))


def model_of(supports: list[Support], gap: float = 0.0, **options: Any) -> Model:
    """A bar of 1 x 0.2 x 0.3 m standing on (or `gap` above) a rigid plane z = 0."""
    part = brick("bar", (1.0, 0.2, 0.3), (3, 2, 2), SOFT, origin=(0, 0, gap))
    return build_model([Body("bar", part), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)], supports=[HELD, *supports], **options)


def simulate(model: Model, scheme: QuasiStatic, steps: int, mu: float = 0.5) -> list[Step]:
    pair = SurfacePair(contact_surface(model, [("bar", "z-")]), contact_surface(model, [("plane", "z+")]), mu, 1e-2)
    return list(Simulation(model, Detector([pair], model.n_nodes), scheme, steps))


SYMMETRY = [Support("bar", ("x",), "x-"), Support("bar", ("y",), "y-"), Support("bar", ("z",), "z-")]


def test_bar_under_end_traction() -> None:
    """u = s/E x, lateral contraction -nu s/E; the load grows over the steps, the answer is exact after each."""
    s = 1e4
    model = model_of(SYMMETRY, gap=1.0, loads=[Traction("bar", "x+", (s, 0, 0), factor=lambda t: t)])
    for step in simulate(model, QuasiStatic(0.25), 4):
        strain = s * step.state.t / SOFT.E
        X = model.reference[: model.n_elastic // 3] - [0, 0, 1]
        u = step.state.x[: model.n_elastic].reshape(-1, 3)
        assert_allclose(u, X * strain * [1, -SOFT.nu, -SOFT.nu], atol=1e-12)
    end = step.support_impulse[model.dof_of_node[np.unique(model.facets("bar", "x-")), 0]].sum()
    assert_allclose(end, -s * 0.2 * 0.3, rtol=1e-9)


def test_driven_end() -> None:
    """A velocity that grows linearly: the displacement t^2/2 is exact, and so is the force E A u / L."""
    model = model_of([*SYMMETRY, Support("bar", ("x",), "x+", velocity=lambda t: 1e-3 * t)], gap=1.0)
    for step in simulate(model, QuasiStatic(0.5), 4):
        pulled = model.dof_of_node[np.unique(model.facets("bar", "x+")), 0]
        u = 1e-3 * step.state.t**2 / 2
        assert_allclose(step.state.x[pulled], u, rtol=1e-12)
        assert_allclose(step.support_impulse[pulled].sum(), SOFT.E * 0.2 * 0.3 * u, rtol=1e-9)


def test_weight_is_carried_by_the_supports() -> None:
    model = model_of([Support("bar", ("x", "y", "z"), "x-")], gap=1.0, gravity=lambda t: (0, 0, -9.81))
    step = simulate(model, QuasiStatic(1.0), 1)[0]
    assert_allclose(step.support_impulse[: model.n_elastic].reshape(-1, 3).sum(axis=0), [0, 0, 0.06 * 1000 * 9.81], atol=1e-8)


def test_contact_carries_the_weight_of_a_guided_body() -> None:
    """Supports that leave one rigid motion would be singular: two faces are guided, the third stands on the plane by contact alone."""
    model = model_of([Support("bar", ("x", "y", "z"), "x-")], gravity=lambda t: (0, 0, -9.81))
    step = simulate(model, QuasiStatic(1.0), 1)[0]
    held = step.support_impulse[: model.n_elastic].reshape(-1, 3).sum(axis=0)
    weight = 0.06 * 1000 * 9.81
    assert step.contact_force_on(0)[2] > 0.3 * weight
    assert_allclose(held + step.contact_force_on(0), [0, 0, weight], atol=1e-6)


def test_influence_of_the_regularisation_vanishes() -> None:
    """A body that only contact holds: what eta takes from the reaction in the first step is proportional to it, and later nothing."""
    weight = 0.06 * 1000 * 9.81
    missing = []
    for eta in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        model = model_of([], gravity=lambda t: (0, 0, -9.81))
        steps = simulate(model, QuasiStatic(0.1, eta), 6)
        missing.append(1 - steps[0].contact_force_on(0)[2] / weight)
        assert_allclose(steps[-1].contact_force_on(0), [0, 0, weight], atol=1e-5 * weight)
    assert_allclose(np.diff(np.log10(missing)), -1, atol=0.05)
    assert abs(missing[-1]) < 1e-7


def test_results_do_not_depend_on_the_regularisation() -> None:
    """A block that only friction holds, pressed and pushed: reactions are statics, displacements agree over five decades of eta."""
    push = Traction("bar", "z+", (300.0, 0, -500.0))
    found = []
    for eta in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        model = model_of([], gravity=lambda t: (2.0, 0, -9.81), loads=[push])
        step = simulate(model, QuasiStatic(0.1, eta), 10)[-1]
        mass, area = 60.0, 0.2
        assert_allclose(step.contact_force_on(0), [-mass * 2.0 - area * 300, 0, mass * 9.81 + area * 500], atol=1e-4)
        assert abs(step.energy.numerical_dissipation) < 1e-6 * step.energy.elastic
        found.append(step.state.x)
    for x in found:
        assert_allclose(x, found[0], atol=3e-4 * np.abs(found[0]).max())


def test_the_regularisation_is_reported() -> None:
    assert QuasiStatic(0.1, 1e-3).notes == ("statics regularised by the mass: eta = 0.001, K + 0.1 M",)
    assert "without regularisation" in QuasiStatic(0.1).notes[0]
    part = QuasiStatic(0.1, 1e-3).cut(4)
    assert part.factors(model_of([])) == pytest.approx(QuasiStatic(0.1, 1e-3).factors(model_of([])))


@pytest.mark.parametrize("eta", [1e-12, 1e-9, 1e-6, 1e-3])
def test_no_penetration_hides_behind_a_long_free_motion(eta: float) -> None:
    """Without contact the body would fall for kilometres in a step; what is accepted is right to a millionth, or the run stops."""
    weight = 0.06 * 1000 * 9.81
    model = model_of([], gravity=lambda t: (0, 0, -9.81 * t))
    try:
        for step in simulate(model, QuasiStatic(1.0, eta), 5):
            assert step.penetration < 1e-6
            assert step.state.x[: model.n_elastic].reshape(-1, 3)[np.unique(model.facets("bar", "z-")), 2].min() > -1e-6
            assert_allclose(step.contact_force_on(0)[2], weight * step.state.t, rtol=1e-5)
    except (NotConverged, InputError) as error:
        assert eta < 1e-4
        assert "larger eta" in str(error)


@pytest.mark.parametrize(
    "supports",
    [
        [],
        [Support("bar", ("x",), "x-"), Support("bar", ("y",), "y-")],
        [Support("bar", ("z",), "z-")],
        [Support("bar", ("x", "z"), "x-")],
    ],
)
def test_floating_bodies_are_refused(supports: list[Support]) -> None:
    with pytest.raises(InputError, match=r"body 'bar': statics with eta = 0.*eta > 0"):
        simulate(model_of(supports), QuasiStatic(1.0), 1)


def test_a_plane_body_held_at_one_face_is_taken() -> None:
    simulate(model_of([Support("bar", ("x", "y", "z"), "x-")]), QuasiStatic(1.0), 1)


def test_rigid_body_without_support_is_refused() -> None:
    model = build_model([*model_of([]).bodies[:1], rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)], supports=SYMMETRY)
    with pytest.raises(InputError, match="body 'plane'"):
        simulate(model, QuasiStatic(1.0), 1)


@pytest.mark.parametrize("options", [{"h": 0.0}, {"h": 1.0, "eta": -1e-3}, {"h": 1.0, "eta": float("nan")}])
def test_refusals(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match="expected a number"):
        QuasiStatic(**options)


def test_the_regularisation_of_a_turned_rigid_body_is_that_of_its_axes() -> None:
    """A rigid plate turned by a right angle about x, under a moment: h^2/eta I(R)^-1 m in the first step, and an energy balance that
    closes. With the inertia in the reference axes in either place the turn is I_y / I_z = 0.61 times that, or the balance open."""
    plate, plane = rigid_box("plate", (0.5, 0.4, 0.02), (0.0, 0.0, 2.0), 10.0), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)
    model = build_model([plate, plane], supports=[HELD], loads=[Force("plate", (0.0, 0.0, 0.0), (0.0, 0.0, 1e-3))])
    place = [body.name for body in model.rigid].index("plate")
    x = np.zeros(model.n_dofs)
    model.rigid_part(x)[place, 3:] = [np.pi / 2, 0.0, 0.0]
    eta, h = 1e-2, 0.1
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("plane", "z+")]), 0.5, 1e-2)
    simulation = Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(h, eta), 1, initial=State(0.0, x, np.zeros(model.n_dofs)))
    step = next(iter(simulation))
    about_y = 10.0 / 12 * (0.5**2 + 0.02**2)  # the plate's own y axis lies along z now
    turn = model.rigid_part(step.state.v * h)[place, 3:]
    assert_allclose(turn, [0.0, 0.0, h**2 / eta * 1e-3 / about_y], rtol=1e-6, atol=1e-12)
    assert abs(step.energy.residual) < 1e-9 * 1e-3 * turn[2]


@pytest.mark.parametrize(("length", "mass", "time"), [(1.0, 1.0, 1.0), (1e3, 1e-3, 1.0), (1e6, 1.0, 1e3)], ids=["m", "mm", "um"])
@pytest.mark.parametrize("law", [Material, neo_hooke])
def test_the_eta_that_is_proposed_carries_a_block(law: Any, length: float, mass: float, time: float) -> None:
    """A block that a rigid floor alone holds, under a pressure: refused with eta = 0 by a message that names an eta, with which the floor
    carries the whole pressure, in any units; one of a millionth of it is named where a step fails."""
    pascal = mass / (length * time**2)
    material = law(1e8 * pascal, 0.3, 1000.0 * mass / length**3)
    part = rectangle("block", (0.2 * length, 0.1 * length), (4, 2), material)
    floor = rigid_rectangle("floor", (length, 0.1 * length), (0.1 * length, -0.05 * length), mass)
    supports = [Support("floor", ("x", "y", "rz"))]
    model = build_model([Body("block", part), floor], supports=supports, loads=[Traction("block", "y+", (0.0, -1e5 * pascal))])
    contact = Everything(model, mu=0.5)
    with pytest.raises(InputError, match="choose eta > 0") as told:
        Simulation(model, contact, QuasiStatic(time), 1)
    eta = float(str(told.value).rsplit(" ", 1)[1])
    if law is not Material:  # dead loads that press make a body that nothing holds unstable: the mass has to bear that until contact does
        text = (*doubts(model, QuasiStatic(time, eta=eta), linkage=None),)[-1]
        eta = float(text.split("has lost its stiffness")[1].split("try eta = ")[1].split(" and")[0])
    *_, last = Simulation(model, contact, QuasiStatic(time, eta=eta), 6)
    assert_allclose(last.contact_force_on(0), [0.0, 0.2 * 1e5 * pascal * length], rtol=1e-5, atol=0.2 * pascal * length)
    assert not [text for text in doubts(model, QuasiStatic(time, eta=eta), linkage=None) if "round-off" in text]
    text, *_ = doubts(model, QuasiStatic(time, eta=1e-10 * eta), linkage=None)
    assert "body 'block', which only contact holds, and round-off hides it: try eta = " in text


def test_a_mass_that_carries_is_named() -> None:
    """A pressed block of which the regularisation, too large, carries part: named on the way and at the end with its share, which is what
    the floor lacks of the load; not where the load has stood for so long that the floor has it."""
    part = rectangle("block", (0.2, 0.1), (4, 2), Material(1e8, 0.3, 1000.0))
    floor = rigid_rectangle("floor", (1.0, 0.1), (0.1, -0.05), 1.0)
    load = Traction("block", "y+", (0.0, -1e5))
    model = build_model([Body("block", part), floor], supports=[Support("floor", ("x", "y", "rz"))], loads=[load])

    def last(eta: float, steps: int) -> tuple[float, list[str]]:
        done = list(Simulation(model, Everything(model, mu=0.5), QuasiStatic(1.0, eta=eta), steps))
        texts = [text for step in done for text in step.remarks if "carried by the mass" in text]
        return 1 - done[-1].contact_force_on(0)[1] / 2e4, texts

    lacking, (first, end) = last(1e9, 3)
    assert "step 1," in first and "shorter" not in first
    assert lacking > 0.5
    assert_allclose(float(end.split(" s: ")[1].split(" of the forces")[0]), lacking, rtol=0.1)
    lacking, texts = last(1e3, 3)
    assert abs(lacking) < 1e-3 and not texts


def test_a_mass_too_small_to_be_seen_is_refused_with_one_that_is() -> None:
    """A rigid block pressed on an elastic one: eta so small that it would fly millions of times its size without contact."""
    column = brick("column", (0.1, 0.1, 0.4), (1, 1, 4), Material(1e8, 0.0, 1000.0))
    bodies = [rigid_box("block", (0.1, 0.1, 0.1), (0.05, 0.05, 0.45), 1.0), Body("column", column)]
    model = build_model(bodies, supports=[Support("column", ("x", "y", "z"), "z-")], loads=[Force("block", (0.0, 0.0, -1e4))])
    contact = Everything(model, mu=0.5)
    with pytest.raises(FcsimError, match=r"a larger eta \(about .* times\)") as told:
        list(Simulation(model, contact, QuasiStatic(1.0, eta=1e-7), 1))
    eta = 1e-7 * float(str(told.value).split("(about ")[1].split(" times")[0])
    *_, last = Simulation(model, contact, QuasiStatic(1.0, eta=eta), 2)
    assert_allclose(last.contact_force_on(model.number["block"]), [0.0, 0.0, 1e4], rtol=1e-5, atol=0.1)
    assert last.state.x[model.n_elastic + 2] == pytest.approx(-1e4 * 0.4 / (1e8 * 0.01), rel=1e-4)


@pytest.mark.parametrize("law", [Velocity(), Rolling(0.1, Velocity(0.5))])
def test_the_law_of_impacts_is_refused(law: Law) -> None:
    """It knows gaps only once they are closed: a block would stay in the other by what is left of the load step."""
    with pytest.raises(InputError, match=r"QuasiStatic, law: expected a law that closes gaps, as Gap\(\), got Velocity"):
        QuasiStatic(1.0, law=law)
