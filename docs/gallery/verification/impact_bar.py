"""
A bar that hits a wall
======================

An elastic bar flies into a rigid wall. A wave runs to its other end and back, then it leaves with the velocity that it came with
(d'Alembert). What the time scheme makes of the shock is another matter: the midpoint rule rings, the generalised-alpha method damps
high frequencies. :doc:`The case </cases/impact_bar/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("impact_bar")
runs = {scheme: case.build(case.parameters(elements=40, scheme=scheme)) for scheme in ("theta", "generalised-alpha")}
steps = {scheme: list(run.simulation) for scheme, run in runs.items()}
middle = len(steps["theta"]) // 2
bar = picture(steps["theta"][middle], exaggeration=1.0, title="The bar on the wall")

# %%
# The force of contact over time: exact is a rectangle of height A sqrt(E rho) v.

import matplotlib.pyplot as plt

figure, axes = plt.subplots()
for scheme, of in steps.items():
    axes.plot([1e6 * step.state.t for step in of], [step.contact_force[:, 0].sum() / 1e3 for step in of], label=scheme)
axes.set(xlabel="time [µs]", ylabel="force of contact [kN]")
axes.legend()
