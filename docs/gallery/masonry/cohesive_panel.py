"""
Mortar that cracks
==================

A panel of bricks whose joints are mortar: they carry tension up to their strength, soften as they open, and then are dry joints with
friction. The work that the cracks took is in the balance of energy of every step. The whole panel, beside the energies of fracture that
went in: :doc:`its page </cases/cohesive_panel/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("cohesive_panel")
panel = case.build(case.parameters(courses=3, width=2, speed=0.04, steps=160))
steps = list(panel.simulation)
cracked = picture(steps[79], steps[-1], title=panel.title)

# %%
# Energy spent on new cracks, and by friction in those that are there.

import matplotlib.pyplot as plt
import numpy as np

figure, axes = plt.subplots()
time = [step.state.t for step in steps]
axes.plot(time, np.cumsum([step.energy.fracture_dissipation for step in steps]), label="fracture")
axes.plot(time, np.cumsum([step.energy.friction_dissipation for step in steps]), label="friction")
axes.set(xlabel="time [s]", ylabel="dissipated [J]")
axes.legend()
