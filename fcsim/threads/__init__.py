"""The threads of fcsim: work that is done side by side, and how it is cut into pieces."""

from fcsim.threads.pieces import PIECES, pieces, pieces_by_work
from fcsim.threads.tasks import begun, side_by_side

__all__ = ["PIECES", "begun", "pieces", "pieces_by_work", "side_by_side"]
