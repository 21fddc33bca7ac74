"""Masonry: problems of blocks from files, their collapse loads by limit analysis and by simulation."""

from fcsim.masonry.analysis import LimitAnalysis, analyse
from fcsim.masonry.collapse import Bracket, Trial, bracket, trial
from fcsim.masonry.joints import Joint, joints_of
from fcsim.masonry.json_file import read_masonry, write_masonry
from fcsim.masonry.limit import LimitLoad, associative_limit, coulomb_limit, limit_problem
from fcsim.masonry.mechanics import BlockModel, pushed, rigid_model, tilted
from fcsim.masonry.problem import Acceleration, Block, Expected, MasonryProblem, PointForce

__all__ = [
    "Acceleration",
    "Block",
    "BlockModel",
    "Bracket",
    "Expected",
    "Joint",
    "LimitAnalysis",
    "LimitLoad",
    "MasonryProblem",
    "PointForce",
    "Trial",
    "analyse",
    "associative_limit",
    "bracket",
    "coulomb_limit",
    "joints_of",
    "limit_problem",
    "pushed",
    "read_masonry",
    "rigid_model",
    "tilted",
    "trial",
    "write_masonry",
]
