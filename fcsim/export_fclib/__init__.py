"""FCLIB files, the exchange format of frictional contact problems, in and out.

Needs NumPy, SciPy and h5py only, so that a problem can be solved far from the program that made it.
"""

from fcsim.export_fclib.content import FclibFile, Info, MatrixInfo, Solution
from fcsim.export_fclib.oddities import odd_matrices
from fcsim.export_fclib.read import read_fclib
from fcsim.export_fclib.write import file_name, write_fclib
from fcsim.problem.rolling import GlobalRollingProblem

__all__ = ["FclibFile", "GlobalRollingProblem", "Info", "MatrixInfo", "Solution", "file_name", "odd_matrices", "read_fclib", "write_fclib"]
