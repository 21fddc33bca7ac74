"""
A bolted bracket
================

A bracket of two materials from a mesh file, of second-order tetrahedra, bolted to a wall and loaded. The bolt is tightened first; what
presses the bracket to the wall is then less at the top than at the bottom. :doc:`The case </cases/bracket/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("bracket")
bracket = case.build(case.parameters(tightened=1, loaded=3, elements="P1"))
*_, last = bracket.simulation
loaded = picture(last, title=bracket.title)
