"""
Rocks
=====

Random convex rocks fall into a box. Vertices meet faces, edges cross edges; `Everything` finds all of it between bodies that nobody listed.
:doc:`The case </cases/rocks/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("rocks")
rubble = case.build(case.parameters(n=8, width=0.4, h=4e-3, steps=160))
steps = list(rubble.simulation)
fallen = picture(*[steps[k] for k in (9, 59, 99, 159)], exaggeration=1.0, title=rubble.title)
