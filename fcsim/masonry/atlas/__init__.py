"""The atlas: problems with published numbers or closed forms, each by limit analysis and by simulation, in one table."""

from fcsim.masonry.atlas.answers import Answer, answered
from fcsim.masonry.atlas.entries import Collapse, Descent, Entry, Rocking, Thickness, built, of_folder
from fcsim.masonry.atlas.table import answers_of, write_atlas

__all__ = [
    "Answer",
    "Collapse",
    "Descent",
    "Entry",
    "Rocking",
    "Thickness",
    "answered",
    "answers_of",
    "built",
    "of_folder",
    "write_atlas",
]
