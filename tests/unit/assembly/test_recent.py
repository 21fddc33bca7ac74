"""Values that are kept: the same array for equal arguments, never a stale one."""

import numpy as np
import pytest

from fcsim.assembly.kinematics.recent import Recent


def test_equal_arguments_give_the_same_array_and_others_their_own():
    asked = []

    def double(x):
        asked.append(x.copy())
        return 2 * x

    kept = Recent(double, count=2)
    a, b, c = (np.array([float(k), -0.5]) for k in range(3))
    assert kept(a) is kept(a.copy()) and len(asked) == 1
    np.testing.assert_array_equal(kept(b), 2 * b)
    a[0] = 7.0  # what was asked with is the caller's
    np.testing.assert_array_equal(kept(a), 2 * a)
    kept(c)  # a third value drives the first one out
    assert len(asked) == 4
    kept(np.array([0.0, -0.5]))
    assert len(asked) == 5


def test_plus_and_minus_zero_are_two_arguments():
    kept = Recent(lambda x: np.copysign(1.0, x))
    assert kept(np.array([0.0]))[0] == 1.0
    assert kept(np.array([-0.0]))[0] == -1.0


def test_what_is_kept_cannot_be_written_to():
    value = Recent(lambda x: x + 1)(np.zeros(2))
    with pytest.raises(ValueError, match="read-only"):
        value[0] = 3.0
