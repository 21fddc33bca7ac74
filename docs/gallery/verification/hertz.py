"""
Hertz's contact
===============

A sphere pressed on a plane. Hertz (1881) knew the force that an approach d takes: F = 4/3 E* sqrt(R) d^(3/2). The mesh here is coarse;
:doc:`the case </cases/hertz/README>` has finer ones, cylinders, and the pressure along the radius.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("hertz")
p = case.parameters(divisions=4, steps=6)
sphere = case.build(p)
steps = list(sphere.simulation)
pressed = picture(steps[-1], exaggeration=1.0, title=sphere.title)

# %%
# Force over approach, beside the formula.

import matplotlib.pyplot as plt
import numpy as np

measure = {sensor.column: [sensor.measure(step) for step in steps] for sensor in sphere.sensors}
approach = np.linspace(0.0, p.approach, 50)
figure, axes = plt.subplots()
axes.plot(1e3 * approach, 4 / 3 * p.E / (1 - p.nu**2) * np.sqrt(p.radius) * approach**1.5, label="Hertz")
axes.plot(1e3 * np.array(measure["approach"]), measure["force"], "o", label="computed")
axes.set(xlabel="approach [mm]", ylabel="force [N]")
axes.legend()
