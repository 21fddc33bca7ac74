"""Glue whose points are too far apart for the zone in which it breaks is named as a run begins, before its first step takes minutes."""

import re

import pytest

import fcsim
from fcsim.contact_law import Cohesive, Gap, Springs, laws_of_bodies
from fcsim.mesh import Body, Material, rectangle, rigid_rectangle
from fcsim.mesh.material import AnyMaterial, saint_venant_kirchhoff


def said(
    material: AnyMaterial, size: tuple[float, float], facets: int, strength: float, energy: float, springs: Springs | None = None
) -> list[str]:
    """What is said of a strip on a held floor, of facets of the same length."""
    length, thickness = size
    strip = Body("strip", rectangle("strip", size, (facets, 1), material))
    floor = rigid_rectangle("floor", (2 * length, thickness), (length / 2, -thickness / 2), 1.0)
    supports = [fcsim.Support("floor", ("x", "y", "rz")), fcsim.Support("strip", ("x", "y"), "x-")]
    law = Cohesive(tension=strength, shear=strength, mode_1=energy, mode_2=energy, springs=springs)
    model = fcsim.build_model([strip, floor], supports=supports)
    simulation = fcsim.Simulation(model, fcsim.Everything(model, mu=0.3), fcsim.QuasiStatic(0.1, law=law), 1)
    return [text for text in simulation._opening(fcsim.timestep.state.at_rest(model, h=0.1)) if "the glue between" in text]


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_points_in_the_zone_of_a_thick_body(unit: float) -> None:
    """Turon and others' laminate: E = 11 GPa, 0.352 N/mm, 60 MPa: E G / f^2 = 1.076 mm, in which three points 0.3 mm apart stand, not
    three 0.4 mm apart."""
    material, given = Material(11e9 / unit, 0.3, 1e3), (60e6 / unit, 352.0)
    (text,) = said(material, (0.04 * unit, 0.04 * unit), 100, *given)
    assert f"breaks over {1.076e-3 * unit:.2f}"[:14] in text and f"points are {4e-4 * unit:.3g} m apart" in text
    zone = float(re.search(r"over (\S+) m", text)[1])  # type: ignore[index]
    assert zone == pytest.approx(11e9 * 352.0 / 60e6**2 * unit, rel=1e-2)
    assert not said(material, (0.03 * unit, 0.03 * unit), 100, *given)


@pytest.mark.parametrize("material", [Material(1e9, 0.0, 1e3), saint_venant_kirchhoff(1e9, 0.0, 1e3)], ids=["linear", "finite strain"])
def test_points_in_the_zone_of_a_strip(material: AnyMaterial) -> None:
    """(E G / f^2)^(1/4) t^(3/4) = (1e9 x 100 / 9e12)^(1/4) x 0.002^(3/4) = 3.07 mm, on facets of 1.25 mm. A third
    of the strength has 5.3 mm, and so does glue that is as soft as it breaks late."""
    (text,) = said(material, (0.1, 0.002), 80, 3e6, 100.0)
    assert "breaks over 0.00307 m" in text and "points are 0.00125 m apart" in text
    assert not said(material, (0.1, 0.002), 80, 1e6, 100.0)
    assert not said(material, (0.1, 0.002), 80, 3e6, 100.0, Springs(normal=5e9, tangential=5e9))


def test_rigid_bodies_have_no_such_zone() -> None:
    blocks = [rigid_rectangle(name, (0.1, 0.1), (0.05, y), 1.0) for name, y in (("floor", -0.05), ("block", 0.05))]
    model = fcsim.build_model(blocks, supports=[fcsim.Support("floor", ("x", "y", "rz"))])
    law = Cohesive(tension=1e9, shear=1e9, mode_1=1.0, mode_2=1.0)
    simulation = fcsim.Simulation(model, fcsim.Everything(model, mu=0.3), fcsim.Theta(1e-3, law=law), 1)
    assert not any("the glue" in text for text in simulation._opening(fcsim.timestep.state.at_rest(model, h=1e-3)))


def test_each_pair_has_its_own_glue_and_those_without_have_none() -> None:
    """A block on a floor with a brittle glue, beside one without and one with a tough glue: the toughest counted for all, so that nothing
    was said of the brittle one, or of a pair that has none."""
    blocks = [Body(f"{k}", rectangle(f"{k}", (0.1, 0.1), (2, 2), Material(1e9, 0.3, 1e3)), translation=(0.2 * k, 0.0)) for k in range(3)]
    model = fcsim.build_model(
        [rigid_rectangle("floor", (1.0, 0.1), (0.25, -0.05), 1.0), *blocks], supports=[fcsim.Support("floor", ("x", "y", "rz"))]
    )

    def said(glue: dict[str | tuple[str, str], fcsim.contact_law.Law]) -> list[str]:
        law = laws_of_bodies(model, glue, Gap())
        simulation = fcsim.Simulation(model, fcsim.Everything(model, mu=0.3), fcsim.QuasiStatic(0.1, 1e-6, law=law), 1)
        return [text for text in simulation._opening(fcsim.timestep.state.at_rest(model, h=0.1)) if "the glue between" in text]

    brittle, tough = (Cohesive(tension=f, shear=f, mode_1=10.0, mode_2=10.0) for f in (1e6, 1e4))  # E G / f^2: 1 cm, 100 m; points: 5 cm
    (text,) = said({("floor", "1"): brittle, ("floor", "2"): tough})
    assert "between '1' and 'floor'" in text
    assert not said({("0", "1"): brittle})  # which stand apart
