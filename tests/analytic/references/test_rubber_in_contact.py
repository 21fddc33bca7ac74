"""Contact problems of finite strain: B5, B11, D7 of the reference list."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import rigid_rectangle
from fcsim.mesh.material import mooney_rivlin, neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta
from tests.analytic.references.loading import ANY, loaded, pair, support_force
from tests.analytic.references.meshes import block, sector, spaced
from tests.analytic.test_nonlinear_references import annulus


def quarter_disk(radius: float) -> object:
    """[0, 1]^2 to a quarter of a disk: squares in the middle, circles at the rim."""

    def at(p: np.ndarray) -> np.ndarray:
        share, length = p.max(axis=1), np.linalg.norm(p, axis=1)
        circle = np.divide(share, length, out=np.ones_like(share), where=length > 0)
        return radius * p * (0.85 * (1 - share) + share * circle)[:, None]

    return at


@pytest.mark.parametrize(("n", "steps"), [(8, 10), pytest.param(16, 20, marks=pytest.mark.slow)])
def test_B5_rubber_cylinder_between_plates(n: int, steps: int) -> None:
    """VM201, T. Sussman and K. J. Bathe: R 200 mm, plane strain, C10 0.293, C01 0.177, K 1410 MPa, frictionless plates closed by 100 and
    200 mm: 250 and 1400 N/mm, read off a figure."""
    part = block("disk", [spaced(0, 1, n)] * 2, mooney_rivlin(0.293, 0.177, 1410.0, 1e-9), "Q1-bbar", quarter_disk(200.0))
    model = build_model(
        [Body("disk", part), rigid_rectangle("plate", (600.0, 50.0), (0.0, 225.0), 1.0)],
        supports=[
            Support("disk", ("x",), "x-"),
            Support("disk", ("y",), "y-"),
            Support("plate", ("x", "rz")),
            Support("plate", ("y",), velocity=-100.0),
        ],
    )
    pairs = [pair(model, ("disk", side), ("plate", "y-"), alert=50.0, rule="nodes") for side in ("y+", "x+")]
    found = loaded(model, pairs, steps)
    force = [2 * support_force(model, step, "disk")[:, 1].sum() for step in found]
    assert_allclose([force[steps // 2 - 1], force[-1]], [250.0, 1400.0], rtol=0.05)


def ring_under_a_plate(mu: float) -> np.ndarray:
    """Forces [N] of half a ring at the quarters of the plate's way."""
    grid = [spaced(0, 1, 6), spaced(0, 1, 40)]
    part = block("ring", grid, neo_hooke(407.0, 0.48, 1e-3), "Q1-bbar", sector(4.15, 6.35, 0.0, 0.5 * np.pi))
    model = build_model(
        [Body("ring", part), rigid_rectangle("plate", (30.0, 1.0), (0.0, 6.85), 1.0)],
        supports=[
            Support("ring", ("y",), "y-"),
            Support("ring", ("x",), "y+"),
            Support("plate", ("x", "rz")),
            Support("plate", ("y",), velocity=-2.225),
        ],
    )
    steps = loaded(model, [pair(model, ("ring", "x+"), ("plate", "y-"), mu, alert=1.0, rule="nodes")], 16)
    return np.array([support_force(model, step, "ring")[:, 1].sum() for step in steps])[3::4]


@pytest.mark.slow
def test_B11_ring_under_a_plate() -> None:
    """A. F. Saleeb, code_aster ssnp501: a quarter of a ring of radii 4.15 and 6.35 cm, E 407 N/cm2, nu 0.48, under a plate that is lowered
    by 2.225 cm: 8.008, 16.017, 24.025, 32.033 N at the quarters (their tolerances 10, 5, 2, 3 %; neo-Hooke is 3.1 % below the third). Plane
    strain: in plane stress, as the list has it, all four are 1 - nu^2 = 0.77 of that. With mu = 0.4 code_aster itself has 8.860, 17.012 and
    24.884 at the first three, beside 8.783, 16.801 and 24.496 without friction: what friction adds is compared."""
    force = ring_under_a_plate(0.0)
    assert np.all(np.abs(force / [8.008, 16.017, 24.025, 32.033] - 1) < [0.10, 0.05, 0.04, 0.03])
    rough = ring_under_a_plate(0.4)
    assert_allclose((rough / force)[:3], [8.860 / 8.783, 17.012 / 16.801, 24.884 / 24.496], rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("smooth", "given"), [(True, 2e-3), (False, 1e-3)])
def test_D7_two_rubber_rings_strike_each_other(smooth: bool, given: float) -> None:
    """Two rings of rubber, 1 m and 0.7 m in radius, thrown at each other with 10 m/s each and 0.6 m beside their middles; no published
    numbers: momentum is kept to round-off, the balance of energy closes, energy rises in no step by more than the error of the stress
    over a step (found: 1.4e-5) and what contacts give (found: 1.0e-3 in one step), since interpolated normals lean on the facets along
    which nodes slide (docs/references.md; facets' own: 8e-5), and the moment of momentum is kept as far as contacts that are found ahead
    of time act across their gaps."""
    ring = annulus(0.7, 1.0, 2, 32, neo_hooke(1e6, 0.4, 1000.0), 1.0, "Q1-bbar")
    model = build_model([Body("left", ring), Body("right", ring, translation=(2.1, 0.6))])
    v = np.zeros((model.n_nodes, 2))
    v[:, 0] = np.repeat([10.0, -10.0], len(ring.points))
    start = State(0.0, np.zeros(model.n_dofs), v.ravel())

    def moments(state: State) -> tuple[np.ndarray, float, float]:
        p, x = model.apply_mass(state.v).reshape(-1, 2), model.reference + state.x.reshape(-1, 2)
        return p.sum(axis=0), float((x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]).sum()), float(0.5 * p.ravel() @ state.v)

    _, turning, kinetic = moments(start)
    mass = float(model.apply_mass(v.ravel())[: 2 * len(ring.points) : 2].sum()) / 10.0
    assert_allclose([turning, kinetic], [mass * 10.0 * 0.6, mass * 100.0], rtol=1e-9)
    touched, energy = 0, kinetic
    run = Simulation(
        model,
        Everything(model, 0.0, smooth=smooth),
        Theta(2e-3, 0.5),
        120,
        SolverSettings(tol=1e-10),
        initial=start,
        limits=ANY,
        witness=None,
    )
    for step in run:
        momentum, moment, _ = moments(step.state)
        assert np.abs(momentum).max() < 1e-9 * mass * 10.0
        assert abs(moment / turning - 1) < 2e-3
        assert step.energy.numerical_dissipation > -5e-5 * kinetic
        assert step.energy.contact_gain < given * kinetic
        assert abs(step.energy.residual) < 1e-8 * kinetic
        touched += np.abs(step.reaction).max(initial=0.0) > 0
        energy = step.energy.kinetic + step.energy.elastic
        assert energy < (1 + 1e-9) * kinetic
    assert touched > 10 and 0.5 * kinetic < energy  # they have struck, and elastically for the most part
