"""
A pile of boxes
===============

Boxes that were set down a little turned and shifted, fall on each other and come to rest. A thousand of them are
:doc:`the case </cases/boxes/README>`; here are 64.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("boxes")
pile = case.build(case.parameters(across=4, gap=0.06, turn=2.0, h=4e-3, steps=80))
steps = list(pile.simulation)
resting = picture(steps[0], steps[-1], exaggeration=1.0, title=pile.title)
print(f"{len(steps[-1].contacts)} contacts at the end")
