"""Loads that follow deformable bodies: forces as the bodies stand, and what they add to their stiffness."""

from fcsim.assembly.kinematics.following.loads import FollowingLoads, following_loads
from fcsim.assembly.kinematics.following.when import When

__all__ = ["FollowingLoads", "When", "following_loads"]
