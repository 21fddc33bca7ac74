"""Round bodies of exact shape that dent facets too long for them are named; those on fine facets and on what is flat are not."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fcsim import Body, ExactContacts, Limits, QuasiStatic, Simulation, Support, build_model, without_contact_of
from fcsim.mesh import rigid_capsule, rigid_cylinder, rigid_sphere
from fcsim.mesh.material import Material
from tests.analytic.references.meshes import block

ANY = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)


def pressed(kind: str, facet: float, depth: float, away: float = 0.3, cells: int = 8, steps: int = 4) -> Simulation:
    """A round body of radius 1, driven into a slab of square facets, `away` of a facet from a vertex."""
    half, R = facet * cells / 2, 1.0
    flat = np.linspace(-half, half, cells + 1)
    part = block("slab", [flat, flat, np.linspace(-half, 0, 5)], Material(1e6, 0.3, 1.0), "Q1-enhanced")
    at = (away * facet, away * facet, R)
    long: Any = {"cylinder": rigid_cylinder, "capsule": rigid_capsule}.get(kind)
    ball = rigid_sphere("ball", R, at, 1.0) if long is None else long("ball", R, 4 * half, at, 1.0, axis=(0, 1, 0))
    held = [Support("slab", ("x", "y", "z"), "z-"), Support("ball", ("x", "y", "rx", "ry", "rz")), Support("ball", ("z",), velocity=-depth)]
    model = build_model([Body("slab", part), ball], supports=held)
    return Simulation(model, ExactContacts(model, mu=0.0), QuasiStatic(1 / steps), steps, limits=ANY, witness=None)


def said(*args: Any, **kwargs: Any) -> list[tuple[int, str]]:
    """The remarks on the dent in a run of `pressed`."""
    return [(step.number, text) for step in pressed(*args, **kwargs) for text in step.remarks if "dents" in text]


def test_a_dent_is_as_deep_in_long_load_steps_as_in_short_ones() -> None:
    """Vertices that a load step takes into the sphere bear in that step: without them four steps gave 53 kN where facets of a third
    of the length gave 68 kN, now 74 kN."""
    long, short = (list(pressed("sphere", 0.2, 0.1, steps=steps))[-1].contact_force_on(1)[2] for steps in (4, 16))
    assert long == pytest.approx(short, rel=0.03)


@pytest.mark.parametrize("kind, depth, away", [("sphere", 0.2, 0.1), ("capsule", 0.1, 0.3), ("cylinder", 0.1, 0.3)])
def test_a_dent_in_long_facets_is_said_once(kind: str, depth: float, away: float) -> None:
    found = said(kind, 0.2, depth, away)
    assert len(found) == 1
    assert "'ball' of radius 1 m dents 'slab' between facets of up to 0.28" in found[0][1]


def test_fine_facets_and_shallow_dents_are_silent() -> None:
    """Facets of 0.05 R (diagonals 0.07), whose vertices bear; and a dent of 5e-5 R, narrower (a = 0.007 R) than a facet of 0.2 R."""
    assert said("sphere", 0.05, 0.01, cells=10) == []
    assert said("sphere", 0.2, 5e-5) == []


def told(depth: float, steps: int = 1, around: bool = False) -> list[tuple[int, float]]:
    """Steps and numbers of facets in the remarks on a sphere of radius 1 that touches few facets of 0.05; around: within another
    detection."""
    run = pressed("sphere", 0.05, depth, 0.0, 6, steps)
    if around:
        run = replace(run, detector=without_contact_of(without_contact_of(run.detector, run.model, []), run.model, []))
    found = [(step.number, text) for step in run for text in step.remarks if "too few to tell" in text]
    assert all(text.startswith(f"step {number}, ") and "'ball' touches 'slab' within 0.0" in text for number, text in found)
    return [(number, float(text.split("which is ")[1].split(" of")[0])) for number, text in found]


def test_few_facets_in_a_contact_are_said() -> None:
    """H. Hertz 1881: a = sqrt(R d) is 1.25 facets, d the depth; the outermost vertex that bears is less than a facet from there."""
    ((number, facets),) = told(0.0625**2, 2)
    assert number == 2 and abs(facets - 1.25) < 0.5
    assert told(0.0625**2, 2, around=True) == [(number, facets)]


def test_a_contact_that_grows_beyond_few_facets_is_not_named_nor_a_single_touch() -> None:
    """Two load steps, 1.8 facets in the radius and 2.5; and one vertex that touches, a = 0.2 facets."""
    assert told(0.125**2, 2) == [] == told(1e-4)
