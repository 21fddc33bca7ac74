"""
Two cubes
=========

The problem behind FCLIB's set Cubes_H8: one elastic cube is pressed on another. It grows with one parameter to any size, which is what
solvers are measured on. :doc:`The case </cases/two_cubes/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("two_cubes")
cubes = case.build(case.parameters(elements=6, steps=5))
*_, last = cubes.simulation
squeezed = picture(last, title=cubes.title)
print(f"{last.problem.M.shape[0]} degrees of freedom, {len(last.contacts)} contacts")
print(f"{last.result.iterations} iterations of {last.result.method}")
