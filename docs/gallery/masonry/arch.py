"""
How thin an arch can be
=======================

A semicircular arch of dry voussoirs stands if its thickness is at least 0.1075 times its radius (Milankovitch 1907). Here are two, one
on each side of the bound: nothing but their thickness differs. :doc:`The case </cases/arch/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("arch")
thick = case.build(case.parameters(thickness_ratio=0.12, h=4e-3, steps=60))
thin = case.build(case.parameters(thickness_ratio=0.09, h=4e-3, steps=100))
*_, standing = thick.simulation
*_, falling = thin.simulation

# %%
# t/R = 0.12: it stands. The reactions follow the line of thrust, which stays within the voussoirs.

thrust = picture(standing, what="contacts", view="front", title="t/R = 0.12 stands")

# %%
# t/R = 0.09: five hinges open, and it falls.

hinges = picture(falling, view="front", exaggeration=1.0, title="t/R = 0.09 falls")
