"""
A stamped sheet
===============

A punch presses a sheet of steel over two shoulders; the sheet yields. When the punch leaves it springs back by what was elastic:
:doc:`the case </cases/stamped_sheet/README>` compares that with beam theory.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("stamped_sheet")
sheet = case.build(case.parameters(cells=(32, 2), stroke=6e-3, pressing=20, leaving=4))
steps = list(sheet.simulation)
stamped = picture(steps[9], steps[19], exaggeration=1.0, title=sheet.title)
