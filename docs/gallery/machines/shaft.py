"""
A shaft in its sleeve
=====================

A shaft that turns in a sleeve with play climbs up its side until the angle to the vertical is that of friction, and is braked by the
friction circle: tan of that angle is mu. :doc:`The case </cases/shaft/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("shaft")
shaft = case.build(case.parameters(cells=(2, 48), steps=150))
steps = list(shaft.simulation)
climbing = picture(steps[-1], what="contacts", exaggeration=1.0, title=shaft.title)

# %%
# What the case measures: each of these is held against its formula on the case's page.

import matplotlib.pyplot as plt

figure, axes = plt.subplots()
for sensor in shaft.sensors[:1]:
    axes.plot([step.state.t for step in steps], [sensor.measure(step) for step in steps], label=f"{sensor.label} [{sensor.unit}]")
axes.set(xlabel="time [s]")
axes.legend()
