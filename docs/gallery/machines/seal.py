"""
A rubber seal
=============

A hollow seal of rubber is pressed into a groove until it meets the side and folds on itself. Large strains (a neo-Hookean energy),
contact with itself, and nothing listed: :doc:`the case </cases/seal/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("seal")
seal = case.build(case.parameters(cells=(2, 28), closing=6e-3, steps=48))
steps = list(seal.simulation)
closing = picture(*[steps[k] for k in (11, 23, 35, 47)], exaggeration=1.0, title=seal.title)
