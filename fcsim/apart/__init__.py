"""Files of others, read in processes of their own with limits on time and memory.

A malformed file can end the process that reads it (gmsh: segmentation fault on a node number of 1e20), hang it or fill its memory; here
that is an error like any other. Mesh files: one process a file, `read_apart`, which runs a module of ours within `limited`. HDF5 files: one
process for all of them, kept as long as this one, `opened_apart`. What a file would bring in besides itself is refused: `confined`.
"""

from fcsim.apart.confined import msh_alone, refuse_others
from fcsim.apart.hdf5_content import Array, Group, Link
from fcsim.apart.hdf5_process import opened_apart, prepare
from fcsim.apart.reading import limited, read_apart

__all__ = ["Array", "Group", "Link", "limited", "msh_alone", "opened_apart", "prepare", "read_apart", "refuse_others"]
