"""
A wall in an earthquake
=======================

The base of a wall follows an acceleration record, here a Ricker pulse along the wall. Blocks rock and slide on their beds and do not
come back to where they were. The full case has five courses and 0.8 s: :doc:`its page </cases/wall_earthquake/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("wall_earthquake")
small = case.parameters(courses=3, blocks=1.5, divisions=(2, 1, 1), scale=3.0, h=2e-3, steps=160)
wall = case.build(small)
steps = list(wall.simulation)
shaken = picture(*steps[39::40], title=wall.title)

# %%
# How far the blocks of each course have moved against the base.

import matplotlib.pyplot as plt

model = wall.simulation.model
figure, axes = plt.subplots()
for name in [body.name for body in model.bodies if body.name != "base"][::2]:
    own = slice(*model.node_offset[[model.number[name], model.number[name] + 1]])
    base = slice(*model.node_offset[[model.number["base"], model.number["base"] + 1]])
    place = [model.node_displacement(step.state.x)[:, 0] for step in steps]
    axes.plot([step.state.t for step in steps], [1e3 * (x[own].mean() - x[base].mean()) for x in place], label=name)
axes.set(xlabel="time [s]", ylabel="displacement over the base [mm]")
axes.legend()
