"""The mesh of the bracket: python cases/bracket/mesh.py FILE.msh [size] writes it with gmsh, tetrahedra with named volumes and surfaces.

An angle of two legs, 60 x 40 x 8 mm, with a round fillet and a hole in the leg that lies on the wall; in the hole a bolt with a head.
Volumes "bracket" and "bolt" share the nodes under the head, and nothing else; surfaces "back" (the leg on the wall), "shank end" (of the
bolt) and "tip" (the end of the other leg).
"""

from __future__ import annotations

import sys
from pathlib import Path

from fcsim.runtime import gmsh_model

LEG, WIDTH, THICK, FILLET = 0.06, 0.04, 0.008, 0.008
HOLE, CLEARANCE, HEAD, HIGH = 0.005, 0.0005, 0.009, 0.006
AT, END = 0.04, 0.001
"""Radius of the bolt and how much wider its hole is, radius and height of its head, where it stands above the corner, and how far before
the wall it ends [m]."""


def write(path: Path, size: float) -> Path:
    """Write the mesh of cells of about `size` [m]."""
    with gmsh_model("bracket") as gmsh:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size / 2)
        cad = gmsh.model.occ
        upright = cad.addBox(0, 0, 0, THICK, WIDTH, LEG)
        lying = cad.addBox(0, 0, 0, LEG, WIDTH, THICK)
        corner = cad.addBox(THICK, 0, THICK, FILLET, WIDTH, FILLET)
        round_ = cad.addCylinder(THICK + FILLET, 0, THICK + FILLET, 0, WIDTH, 0, FILLET)
        corner = cad.cut([(3, corner)], [(3, round_)])[0]
        angle = cad.fuse([(3, upright)], [(3, lying), *corner])[0]
        angle = cad.cut(angle, [(3, cad.addCylinder(0, WIDTH / 2, AT, THICK, 0, 0, HOLE + CLEARANCE))])[0]
        shank = cad.addCylinder(END, WIDTH / 2, AT, THICK - END, 0, 0, HOLE)
        head = cad.addCylinder(THICK, WIDTH / 2, AT, HIGH, 0, 0, HEAD)
        bolt = cad.fuse([(3, shank)], [(3, head)])[0]
        parts = cad.fragment(angle, bolt)[1]
        cad.synchronize()
        whole, own = [{tag for _, tag in part} for part in parts]
        gmsh.model.addPhysicalGroup(3, sorted(whole - own), name="bracket")
        gmsh.model.addPhysicalGroup(3, sorted(own), name="bolt")
        named: dict[str, list[int]] = {"back": [], "shank end": [], "tip": []}
        for _, face in gmsh.model.getEntities(2):
            low, high = gmsh.model.getBoundingBox(2, face)[:3], gmsh.model.getBoundingBox(2, face)[3:]
            volumes = set(gmsh.model.getAdjacencies(2, face)[0])
            if abs(high[0]) < 1e-6:
                named["back"].append(face)
            elif abs(high[0] - END) < 1e-6 and volumes <= own:
                named["shank end"].append(face)
            elif abs(low[0] - LEG) < 1e-6:
                named["tip"].append(face)
        for name, faces in named.items():
            gmsh.model.addPhysicalGroup(2, faces, name=name)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    return path


if __name__ == "__main__":
    print(write(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 5e-3))
