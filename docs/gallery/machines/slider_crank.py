"""
A slider crank
==============

A crank turns, a flexible rod follows, a slider pushes a box: pins and a slider are equations, the box is contact, and one solve of each
step has both. :doc:`The case </cases/slider_crank/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("slider_crank")
machine = case.build(case.parameters(h=5e-3, steps=220))
steps = list(machine.simulation)
turning = picture(*[steps[k] for k in (54, 109, 164, 219)], exaggeration=1.0, title=machine.title)
