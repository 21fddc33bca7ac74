"""
A bar that hits a wall
======================

An elastic bar, its sides held, flies into a rigid wall. A wave runs to its other end and back, then it leaves with the velocity that it
came with (d'Alembert). What the time scheme makes of the shock is another matter: the midpoint rule keeps the wave, implicit Euler
(theta = 1) damps it, and the bar leaves slower. :doc:`The case </cases/impact_bar/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("impact_bar")
runs = {theta: case.build(case.parameters(elements=40, theta=theta)) for theta in (0.5, 1.0)}
steps = {theta: list(run.simulation) for theta, run in runs.items()}
middle = len(steps[0.5]) // 2
bar = picture(steps[0.5][middle], exaggeration=1.0, title="The bar on the wall")

# %%
# The force of contact over time: exact is a rectangle of height rho c v A, where c is the speed of plane waves between held sides,
# sqrt(E (1 - nu) / (rho (1 + nu) (1 - 2 nu))). The first steps overshoot, since the mass at the wall is stopped within one of them.

import matplotlib.pyplot as plt

figure, axes = plt.subplots()
exact = next(sensor for sensor in runs[0.5].sensors if sensor.column == "exact_force")
axes.plot([1e6 * step.state.t for step in steps[0.5]], [exact.measure(step) / 1e3 for step in steps[0.5]], "k:", label="exact")
for theta, of in steps.items():
    axes.plot([1e6 * step.state.t for step in of], [step.contact_force[:, 0].sum() / 1e3 for step in of], label=f"theta = {theta:g}")
axes.set(xlabel="time [µs]", ylabel="force of contact [kN]")
axes.legend()
