"""Blocks where they have come to, as files: surfaces, drawings, masonry problems, COMPAS meshes."""

from fcsim.masonry.exports.moved import moved_blocks
from fcsim.masonry.exports.write import FORMATS, refuse_format, write_blocks

__all__ = ["FORMATS", "moved_blocks", "refuse_format", "write_blocks"]
