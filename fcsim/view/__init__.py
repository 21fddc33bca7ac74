"""Seeing a run: VTK series for ParaView (`SeriesWriter`), and pictures, film and plots of a run's folder (`render`)."""

from fcsim.running.vtk_series import SeriesWriter
from fcsim.view.render import render

__all__ = ["SeriesWriter", "render"]
