"""The few VTK classes that a series is written with, loaded on first use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fcsim.errors import MissingDependency
from fcsim.files import replacing
from fcsim.running.series.units import with_unit

if TYPE_CHECKING:
    from vtkmodules.vtkCommonCore import vtkDataArray, vtkPoints, vtkStringArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPointSet

# Level 1: three quarters of the size at a third of the time of level 6 more; zlib because meshio and other readers know no LZ4.
COMPRESSION_LEVEL = 1


class VTK:
    """The few VTK classes a writer needs, loaded on first use (a quarter of the time that all of pyvista takes)."""

    def __init__(self) -> None:
        try:
            core, data, io, support = (
                import_module(f"vtkmodules.{name}") for name in ("vtkCommonCore", "vtkCommonDataModel", "vtkIOXML", "util.numpy_support")
            )
        except ImportError as error:
            raise MissingDependency(f"VTK cannot be imported ({error}), which the VTK files need: pip install 'fcsim[view]'") from None
        self.core, self.data, self.io, self.support = core, data, io, support

    @contextmanager
    def _quiet(self) -> Iterator[None]:
        """VTK prints pages on a full disk; the error says it in a line."""
        shown = self.core.vtkObject.GetGlobalWarningDisplay()
        self.core.vtkObject.SetGlobalWarningDisplay(0)
        try:
            yield
        finally:
            self.core.vtkObject.SetGlobalWarningDisplay(shown)

    def array(self, name: str, values: NDArray) -> vtkDataArray:
        array = self.support.numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(with_unit(name))
        return array

    def texts(self, name: str, values: Iterable[str]) -> vtkStringArray:
        array = self.core.vtkStringArray()
        array.SetName(name)
        for value in values:
            array.InsertNextValue(value)
        return array

    def points(self, coordinates: NDArray) -> vtkPoints:
        points = self.core.vtkPoints()
        points.SetData(self.support.numpy_to_vtk(in_space(coordinates), deep=True))
        return points

    def cells(self, offsets: NDArray, connectivity: NDArray) -> vtkCellArray:
        cells = self.data.vtkCellArray()
        cells.SetData(
            self.support.numpy_to_vtkIdTypeArray(offsets.astype(np.int64), deep=True),
            self.support.numpy_to_vtkIdTypeArray(connectivity.astype(np.int64), deep=True),
        )
        return cells

    def write(self, dataset: vtkPointSet, path: Path, t: float) -> None:
        dataset.GetFieldData().AddArray(self.array("TimeValue", np.array([t])))
        writer = getattr(self.io, "vtkXMLPolyDataWriter" if path.suffix == ".vtp" else "vtkXMLUnstructuredGridWriter")()
        writer.SetInputData(dataset)
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToZLib()
        writer.SetCompressionLevel(COMPRESSION_LEVEL)
        with replacing(path) as temporary, self._quiet():
            writer.SetFileName(str(temporary))
            if writer.Write() != 1 or writer.GetErrorCode():
                raise OSError(f"{path}: VTK could not write the file (error code {writer.GetErrorCode()}; disk full, or not writable?)")


def in_space(vectors: NDArray) -> NDArray:
    """(n, 2) or (n, 3) -> contiguous (n, 3), z = 0 in 2D: VTK knows three dimensions only."""
    return np.ascontiguousarray(np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1]))))
