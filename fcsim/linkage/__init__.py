"""What holds bodies together: ball joints, hinges, sliders, rods, cables, springs with dashpots, tied and bonded surfaces; control."""

from fcsim.linkage.cables import WithCables, without_contact_of
from fcsim.linkage.linkage import Linkage, Rows
from fcsim.linkage.links import Ball, Bonded, Cable, Control, Hinge, Link, Rod, Slider, SpringDamper, Tied

__all__ = [
    "Ball",
    "Bonded",
    "Cable",
    "Control",
    "Hinge",
    "Link",
    "Linkage",
    "Rod",
    "Rows",
    "Slider",
    "SpringDamper",
    "Tied",
    "WithCables",
    "without_contact_of",
]
