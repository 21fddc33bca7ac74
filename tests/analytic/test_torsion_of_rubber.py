"""A rod of nearly incompressible rubber twisted at a fixed length, against R. S. Rivlin, Phil. Trans. A 241 (1948) 379: of
neo-Hooke's energy the moment mu pi R^4 phi / 2 and the thrust mu pi R^4 phi^2 / 4 along the axis, phi the angle a length."""

import numpy as np

from fcsim import Body, Everything, QuasiStatic, Simulation, Support, build_model
from fcsim.assembly.supports import DrivenRotation
from fcsim.mesh import part_from_gmsh
from fcsim.mesh.material.energies import neo_hooke_isochoric
from fcsim.running.sensors import support_force, support_moment
from fcsim.runtime import gmsh_model

RADIUS, LENGTH, MU = 0.01, 0.02, 1e6


def test_moment_and_thrust() -> None:
    with gmsh_model("rod") as gmsh:
        rod = gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, LENGTH, RADIUS)
        gmsh.model.occ.synchronize()
        for _, face in gmsh.model.getEntities(2):
            height = gmsh.model.occ.getCenterOfMass(2, face)[2]
            if abs(height - LENGTH / 2) > 0.4 * LENGTH:
                gmsh.model.addPhysicalGroup(2, [face], name="lower" if height < LENGTH / 2 else "upper")
        gmsh.model.addPhysicalGroup(3, [rod], name="rod")
        gmsh.option.setNumber("Mesh.MeshSizeMax", RADIUS / 3)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        part = part_from_gmsh(gmsh, "rod", neo_hooke_isochoric(MU, 2000 * MU, 1000.0))
    angle = 0.2
    turn = DrivenRotation("rod", lambda t: angle * t, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), surface="upper")
    model = build_model([Body("rod", part)], supports=[Support("rod", ("x", "y", "z"), "lower"), turn])
    moment = support_moment("moment", model, "rod", "rz", (0.0, 0.0, 0.0), "upper")
    thrust = support_force("thrust", model, "rod", "z", "upper")
    steps = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.5), 2))
    for step in steps:
        phi = angle * step.state.t / LENGTH
        assert abs(moment.measure(step) / (MU * np.pi * RADIUS**4 * phi / 2) - 1) < 0.02
        assert abs(thrust.measure(step) / (-MU * np.pi * RADIUS**4 * phi**2 / 4) - 1) < 0.02
        assert step.substeps == 1  # a step of 0.1 rad is no more than Newton's method goes in one piece
        assert len(step.linearised) <= 6
