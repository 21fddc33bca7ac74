"""Directions of a support that are none."""

import pytest

from fcsim import Support, build_model
from fcsim.errors import InputError
from fcsim.mesh import rigid_box


def test_the_wrong_one_of_many_directions_is_named() -> None:
    box = rigid_box("floor", size=(1.0, 1.0, 0.1), centre=(0.0, 0.0, 0.0), mass=1.0)
    with pytest.raises(InputError, match="support of body 'floor': expected directions among x, y, z, rx, ry, rz, got 'rq'"):
        build_model([box], supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rq"))])
    with pytest.raises(InputError, match="got 'rx'"):
        build_model([box], supports=[Support("floor", "rx")])
