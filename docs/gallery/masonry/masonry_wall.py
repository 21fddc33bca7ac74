"""
A masonry wall, compressed and sheared
======================================

Elastic blocks in running bond between two platens; the upper one presses with 30 kN and moves sideways. The wall carries as a diagonal
strut, and head joints open in a staircase. This is a small wall for a short time, sheared ten times as fast as the reference case, whose
12 blocks take 500 steps: :doc:`its page </cases/masonry_wall/README>` has its figures, beside those of another program.
"""

from pathlib import Path

from fcsim import load_case
from fcsim.view import picture

case = load_case("masonry_wall")
small = case.parameters(courses=3, blocks=2.5, divisions=(4, 2, 2), shear_velocity=-1e-2, steps=80)
wall = case.build(small)
steps = list(wall.simulation)
stress = picture(steps[-1], title=wall.title)

# %%
# The reactions at the contacts, blue where they stick, red where they slip: read together, they draw the strut.

strut = picture(steps[-1], what="contacts", view="front", title=wall.title)

# %%
# The horizontal force rises to the bound of friction of the upper bed, 0.53 times the weight on it.

import matplotlib.pyplot as plt

sensor = next(sensor for sensor in wall.sensors if sensor.column == "bottom_Rx")
figure, axes = plt.subplots()
axes.plot([step.state.t for step in steps], [sensor.measure(step) / 1e3 for step in steps])
axes.set(xlabel="time [s]", ylabel=f"{sensor.label} [kN]")

# %%
# The reference wall itself, where ``make wall`` has left its run in ``results/masonry_wall``; without it the picture below is missing, and
# the words in its place say so.

whole = Path("../../../results/masonry_wall/pictures/stress.png")
if whole.is_file():
    figure, axes = plt.subplots(figsize=(8.0, 5.0))
    axes.imshow(plt.imread(whole))
    axes.set_axis_off()
else:
    print("No stored run in results/masonry_wall: `make wall` makes it, some minutes.")
