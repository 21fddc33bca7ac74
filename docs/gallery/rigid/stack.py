"""
Bricks over an edge
===================

Four bricks lean over an edge by 0.97 of the largest overhang that statics allows, 1/2 (1 + 1/2 + 1/3 + 1/4) of their length, and stand; by
1.03 of it they fall. :doc:`The case </cases/stack/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("stack")
stands, falls = (list(case.build(case.parameters(overhang=share, h=4e-3, steps=120)).simulation) for share in (0.97, 1.03))
below = picture(stands[-1], view="front", exaggeration=1.0, title="0.97 of the largest overhang")
beyond = picture(falls[-1], view="front", exaggeration=1.0, title="1.03 of the largest overhang")
