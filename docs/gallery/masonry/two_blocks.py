"""
Two blocks
==========

The example of :doc:`the first page </README>`: one elastic block is pulled over another, which stands on a rigid floor. Coulomb's law
holds at every point where they touch: friction is at most 0.4 times the pressure, and it is just that where the block slides.
"""

from fcsim import Body, Everything, Material, Simulation, Support, Theta, build_model
from fcsim.mesh import brick, rigid_box
from fcsim.view import picture

stone = Material(E=2.2e9, nu=0.2, density=2000.0)
block = brick("block", size=(0.2, 0.1, 0.1), divisions=(8, 4, 4), material=stone)
floor = rigid_box("floor", size=(1.0, 0.4, 0.1), centre=(0.1, 0.05, -0.05), mass=1.0)
held = Support("floor", ("x", "y", "z", "rx", "ry", "rz"))
pulled = Support("upper", ("x",), surface="z+", velocity=0.01)  # 10 mm/s
bodies = [floor, Body("lower", block), Body("upper", block, translation=(0.0, 0.0, 0.1))]
model = build_model(bodies, supports=[held, pulled], gravity=lambda t: (0.0, 0.0, -9.81), beta=1e-3)
contact = Everything(model, mu={("upper", "lower"): 0.4, ("*", "*"): 0.6})
steps = list(Simulation(model, contact, Theta(h=1e-3), steps=30))

# %%
# The bodies at the end, coloured by stress; displacements are drawn larger than they are by the factor in the title.

bodies_picture = picture(steps[-1], title="A block pulled over another")

# %%
# The points of contact, and along each a line in the direction of its reaction.

contact_picture = picture(steps[-1], what="contacts", view="front", title="Where they touch")

# %%
# The friction on the upper block settles at 0.4 times its weight, 15.7 N.

import matplotlib.pyplot as plt

figure, axes = plt.subplots()
upper = model.number["upper"]
axes.plot([step.state.t for step in steps], [-step.contact_force_on(upper)[0] for step in steps], label="friction")
axes.plot(
    [step.state.t for step in steps], [0.4 * step.contact_force_on(upper)[2] for step in steps], "--", label="0.4 times the normal force"
)
axes.set(xlabel="time [s]", ylabel="force on the upper block [N]")
axes.legend()
