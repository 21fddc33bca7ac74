"""
A facade tilted until it falls
==============================

Forty blocks on a table that is tilted slowly. When it falls, and by which mechanism, can be computed without any time: by limit analysis,
a linear programme. The simulation starts at 26 degrees, after limit analysis has said that nothing moves before:
:doc:`its page </cases/tilting_facade/README>` compares the two.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("tilting_facade")
facade = case.build(case.parameters(start=26.0, rate=20.0, h=1e-2, steps=90))
steps = list(facade.simulation)
falling = picture(*[steps[k] for k in (9, 49, 69, 89)], exaggeration=1.0, title=facade.title)
