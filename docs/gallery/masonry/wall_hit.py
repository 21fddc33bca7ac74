"""
A wall that is hit
==================

A heavy cube flies into a wall at 20 m/s. It is fast: in one step it goes a sixth of its edge, so contacts are looked for along its way.
The blocks are rigid, their contacts found between all bodies without a list. The full wall: :doc:`its page </cases/wall_hit/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("wall_hit")
wall = case.build(case.parameters(courses=4, blocks=3.0, height=0.4, steps=90))
steps = list(wall.simulation)
moments = picture(*[steps[k] for k in (2, 14, 39, 89)], exaggeration=1.0, title=wall.title)
