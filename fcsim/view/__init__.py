"""Seeing a run: pictures, film and plots of its folder (`render`), VTK series for ParaView (`SeriesWriter`), and steps in memory as a
picture (`picture`) or as a page that turns and plays (`interactive`)."""

from fcsim.running.vtk_series import SeriesWriter
from fcsim.view.in_memory import Interactive, Picture, interactive, picture
from fcsim.view.render import render

__all__ = ["Interactive", "Picture", "SeriesWriter", "interactive", "picture", "render"]
