"""Joints of a run: where bodies lay face to face at the beginning, and how far they have opened since (`find_joints`)."""

from fcsim.view.joints.find import find_joints
from fcsim.view.joints.joints import Joints, configuration
from fcsim.view.joints.moved_on import without_moved_on

__all__ = ["Joints", "configuration", "find_joints", "without_moved_on"]
