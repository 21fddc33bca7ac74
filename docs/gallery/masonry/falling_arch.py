"""
An arch that falls to the ground
================================

The same arch, thinner and of deformable voussoirs, all the way down: bodies that turn by any angle, break contact, meet others and the
ground. The full fall: :doc:`its page </cases/falling_arch/README>`.
"""

from fcsim import load_case
from fcsim.view import picture

case = load_case("falling_arch")
arch = case.build(case.parameters(voussoirs=12, blocks_are="rigid", steps=420))
steps = list(arch.simulation)
down = picture(*[steps[k] for k in (99, 239, 329, 419)], exaggeration=1.0, view="front", title=arch.title)
