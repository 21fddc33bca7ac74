"""Meshes: materials, parts and bodies, bricks and walls by gmsh, mesh files in and out."""

from fcsim.mesh.arch import SemicircularArch, semicircular_arch
from fcsim.mesh.blocks import brick, part_from_gmsh, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.exact.rigid_polyhedron import rigid_polyhedron
from fcsim.mesh.exact.rigid_shapes import rigid_capsule, rigid_cylinder, rigid_plane, rigid_sphere
from fcsim.mesh.graded import graded_brick, graded_rectangle, half_ball, half_disk
from fcsim.mesh.io import read_mesh, read_parts, write_mesh
from fcsim.mesh.masonry import RunningBond, running_bond
from fcsim.mesh.material import Material
from fcsim.mesh.named.places import with_surface
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.mesh.quality import check_quality
from fcsim.mesh.rigid import BlockKind, blocks_that_are, mass_properties, rigid_body
from fcsim.mesh.solids.meshed import meshed_polygon
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

__all__ = [
    "BlockKind",
    "Body",
    "Material",
    "Part",
    "RigidBody",
    "RunningBond",
    "SemicircularArch",
    "blocks_that_are",
    "brick",
    "check_quality",
    "graded_brick",
    "graded_rectangle",
    "half_ball",
    "half_disk",
    "mass_properties",
    "meshed_polygon",
    "part_from_gmsh",
    "read_mesh",
    "read_parts",
    "rectangle",
    "rigid_body",
    "rigid_box",
    "rigid_capsule",
    "rigid_cylinder",
    "rigid_plane",
    "rigid_polygon",
    "rigid_polyhedron",
    "rigid_rectangle",
    "rigid_sphere",
    "running_bond",
    "semicircular_arch",
    "with_surface",
    "write_mesh",
]
