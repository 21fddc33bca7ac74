"""Seeing a run: VTK series for ParaView (`SeriesWriter`), and pictures, film and plots of a run's folder (`render`)."""

from fcsim.view.render import render
from fcsim.view.vtk import SeriesWriter

__all__ = ["SeriesWriter", "render"]
