"""Masonry: problems of blocks from files, their collapse loads by limit analysis and by simulation."""

from fcsim.masonry.collapse import Bracket, Trial, bracket, trial
from fcsim.masonry.histories.branch import Branch, push_by_displacement
from fcsim.masonry.histories.settle import Movement, Settlement, movements_of, settle
from fcsim.masonry.histories.shake import Shake, shake, shaken
from fcsim.masonry.json_file import read_masonry, write_masonry
from fcsim.masonry.limit_analysis.analysis import LimitAnalysis, analyse
from fcsim.masonry.limit_analysis.friction_reduction import friction_factor
from fcsim.masonry.limit_analysis.joints import Joint, joints_of
from fcsim.masonry.limit_analysis.limit import LimitLoad, associative_limit, coulomb_limit
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem, limit_problem
from fcsim.masonry.limit_analysis.reactions import SupportForces, support_forces
from fcsim.masonry.meshes import masonry_of_mesh
from fcsim.masonry.models import read_model
from fcsim.masonry.problem import Acceleration, BaseAcceleration, Block, Expected, MasonryProblem, PointForce
from fcsim.masonry.pushes import pushed, tilted
from fcsim.masonry.structure import Stone, structure
from fcsim.masonry.surfaces import masonry_of_surfaces

__all__ = [
    "Acceleration",
    "BaseAcceleration",
    "Block",
    "Bracket",
    "Branch",
    "Expected",
    "Joint",
    "LimitAnalysis",
    "LimitLoad",
    "LimitProblem",
    "MasonryProblem",
    "Movement",
    "PointForce",
    "Settlement",
    "Shake",
    "Stone",
    "SupportForces",
    "Trial",
    "analyse",
    "associative_limit",
    "bracket",
    "coulomb_limit",
    "friction_factor",
    "joints_of",
    "limit_problem",
    "masonry_of_mesh",
    "masonry_of_surfaces",
    "movements_of",
    "push_by_displacement",
    "pushed",
    "read_masonry",
    "read_model",
    "settle",
    "shake",
    "shaken",
    "structure",
    "support_forces",
    "tilted",
    "trial",
    "write_masonry",
]
