"""
Meshes that do not match
========================

Two blocks whose meshes have nothing to do with each other, pressed and then sheared. Contact is integrated over the overlap of both
surfaces (``mortar``), so that a constant pressure stays constant across the joint. Other programs have solved the same:
:doc:`the case </cases/press_and_shear/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("press_and_shear")
blocks = case.build(case.parameters(top_divisions=(5, 5, 2), bottom_divisions=(7, 7, 2), shear_steps=6))
steps = list(blocks.simulation)
pressed_and_sheared = picture(steps[1], steps[-1], title=blocks.title)
