"""Blocks as a DXF drawing: outlines of a wall, closed surfaces of solids."""

from __future__ import annotations

from pathlib import Path

from fcsim.errors import MissingDependency
from fcsim.files import replacing_for_good
from fcsim.masonry.bodies import outline
from fcsim.masonry.problem import MasonryProblem

FREE, HELD = "BLOCKS", "SUPPORTS"


def write_drawing(path: Path, problem: MasonryProblem) -> None:
    """Write a drawing in metres: of a plane problem a closed polyline (x, z) a block, of solids a polyface mesh, in layers of free and held
    ones; each with its block's name as data of the application FCSIM. MissingDependency without ezdxf."""
    try:
        import ezdxf
        from ezdxf.render import MeshBuilder
    except ImportError as error:
        raise MissingDependency(f"DXF drawings need ezdxf ({error}): pip install 'fcsim[masonry]'") from None
    drawing = ezdxf.new("R2010")
    drawing.header["$INSUNITS"] = 6  # metres
    drawing.appids.add("FCSIM")
    drawing.layers.add(FREE, color=30)
    drawing.layers.add(HELD, color=8)
    space = drawing.modelspace()
    for block in problem.blocks:
        about = {"layer": HELD if block.support else FREE}
        if problem.dimension == 2:
            entity = space.add_lwpolyline(outline(block)[0].tolist(), close=True, dxfattribs=about)
        else:
            mesh = MeshBuilder()
            mesh.add_mesh(vertices=block.surface.points.tolist(), faces=[list(face) for face in block.surface.polygons])
            entity = mesh.render_polyface(space, dxfattribs=about)
        entity.set_xdata("FCSIM", [(1000, block.name)])
    with replacing_for_good(path) as temporary:
        drawing.saveas(temporary)
