"""
Partial slip
============

A pressed cylinder is pushed sideways by less than friction could hold. Cattaneo (1938) and Mindlin (1949): the contact sticks in its
middle and slips at its edges, and the stick zone shrinks as the push grows. :doc:`The case </cases/cattaneo_mindlin/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("cattaneo_mindlin")
cylinder = case.build(case.parameters(divisions=12, steps=10))
steps = list(cylinder.simulation)
pushed = picture(steps[-1], exaggeration=1.0, title=cylinder.title)

# %%
# Normal reactions, and the tangential ones between the two lines of the bound of friction.

import matplotlib.pyplot as plt
import numpy as np

last = steps[-1]
order = np.argsort(last.contacts.point[:, 0])
x, force = 1e3 * last.contacts.point[order, 0], last.contact_force[order]
figure, axes = plt.subplots()
axes.plot(x, 0.3 * force[:, 0], "--", color="0.4", label="bound of friction")
axes.plot(x, -0.3 * force[:, 0], "--", color="0.4")
axes.plot(x, force[:, 1], "o-", label="tangential reaction")
axes.set(xlabel="x [mm]", ylabel="reaction of a contact [N]")
axes.legend()
