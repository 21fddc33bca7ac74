"""
Grains in a box
===============

Spheres of several sizes are poured into a box. They are exact: their contacts are found from centres and radii, not from meshes.
:doc:`The case </cases/granular/README>` holds the weight on the floor and the rest of the heap against statics.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("granular")
heap = case.build(case.parameters(n=40, width=0.16, h=4e-3, steps=150))
steps = list(heap.simulation)
poured = picture(*[steps[k] for k in (9, 39, 74, 149)], exaggeration=1.0, title=heap.title)

# %%
# Kinetic energy: what the fall gave, friction and impacts take.

import matplotlib.pyplot as plt

figure, axes = plt.subplots()
axes.semilogy([step.state.t for step in steps], [step.energy.kinetic for step in steps])
axes.set(xlabel="time [s]", ylabel="kinetic energy [J]")
