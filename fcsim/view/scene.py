"""Off-screen rendering of one instant of a run: deformed blocks and rigid bodies from a fixed camera, as an image array."""

from __future__ import annotations

import functools
import importlib.util
import os
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.errors import InputError, MissingDependency
from fcsim.running.folder import Instant, RunFolder
from fcsim.running.series.units import without_unit
from fcsim.runtime import ISOLATED, without_local_options
from fcsim.view.framed import Framed
from fcsim.view.standing_before import standing_before

if TYPE_CHECKING:
    from types import ModuleType

    from matplotlib.colors import Colormap
    from pyvista import DataSet

# Automatic exaggeration: the largest displacement is shown as at most this share of the size of the whole, with a round factor.
# The factors below differ by at most 1.5, so it is at least two thirds of it.
SHOWN_DISPLACEMENT = 0.08
NEGLIGIBLE = 1e-10  # share of the size below which a displacement is round-off, shown as it is
ABOVE_ROUND_OFF = 10.0  # times what stresses have of round-off: the colours end no lower
ROUND_FACTORS = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0])

# magma, perceptually uniform, from pale to dark without its blackest fifth: an unloaded block looks like stone, a mesh line shows on it
COLOUR_MAP, DARKEST = "magma_r", 0.82

MARGIN = 0.015
TALLEST = 0.75
"""Height of an image by its width."""
_PROBE = "from vtkmodules.vtkRenderingOpenGL2 import *; from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkRenderer; \
w = vtkRenderWindow(); w.SetOffScreenRendering(1); w.AddRenderer(vtkRenderer()); w.Render()"


@functools.cache
def offscreen() -> ModuleType:
    """Return pyvista, ready to render without a display; MissingDependency where it, or every OpenGL library, is absent.

    VTK ends the process where it finds no OpenGL, so a child process tries EGL, OSMesa and VTK's own choice first.
    """
    if importlib.util.find_spec("pyvista") is None or importlib.util.find_spec("vtkmodules") is None:
        raise MissingDependency("pyvista is not installed, which pictures and films need: pip install 'fcsim[view]'")
    variable = "VTK_DEFAULT_OPENGL_WINDOW"
    choices = [os.environ[variable]] if os.environ.get(variable) else []
    choices += ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"] if sys.platform == "linux" else []
    for choice in [*choices, None]:
        environment = {name: value for name, value in os.environ.items() if name != variable} | ({variable: choice} if choice else {})
        if subprocess.run([sys.executable, ISOLATED, "-c", _PROBE], env=environment, capture_output=True, check=False).returncode == 0:
            os.environ.pop(variable, None)
            os.environ.update({variable: choice} if choice else {})
            with without_local_options():  # of matplotlib, which it loads
                import pyvista

            return pyvista
    raise MissingDependency(
        "VTK finds no OpenGL library to draw pictures with (pip install 'fcsim[view]' brings VTK, the system brings EGL or OSMesa): "
        "on Debian, apt-get install libegl1 libgl1-mesa-dri, or libosmesa6"
    )


@dataclass(frozen=True, eq=False)
class Survey:
    """What stays the same in all pictures of a run.

    exaggeration  factor on displacements
    stress        (2,) [Pa] the range of colours: from 0 to the largest 99th percentile of an instant, and to above what may be round-off,
                  as in bodies that fall; None without blocks
    force         [N] the largest contact reaction
    low, high     (3,) [m] corners of the box that pictures show, see `framed`
    planar        2D: seen along z
    last          the last instant with rigid bodies, None = none
    """

    exaggeration: float
    stress: tuple[float, float] | None
    force: float
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    planar: bool
    last: Instant | None = None


def read(path: Path) -> DataSet:
    """Return the data set of a .vtu or .vtp file, its arrays by their names without units."""
    with warnings.catch_warnings(action="ignore", category=UserWarning):  # of VTK's reader: the error below says it
        data = offscreen().read(path)
    for arrays in (data.point_data, data.cell_data, data.field_data):
        for array in [arrays.VTKObject.GetAbstractArray(k) for k in range(arrays.VTKObject.GetNumberOfArrays())]:
            array.SetName(without_unit(array.GetName() or ""))
    if "displacement" not in data.point_data:
        raise InputError(f"{path}: expected a VTK file of points with a displacement, could not read one")
    return data


def gravity_of(instant: Instant) -> NDArray[np.float64] | None:
    """(3,) [m/s^2] at an instant; None where there is none, or the file says none, as those of fcsim 0.2."""
    if instant.contacts is None or "gravity" not in (fields := read(instant.contacts).field_data):
        return None
    g = np.asarray(fields["gravity"], dtype=np.float64).ravel()
    return g if g.any() else None


def survey(run: RunFolder, instants: tuple[Instant, ...], exaggeration: float | None = None) -> Survey:
    """Look through the instants once for the displacement factor (None: automatic), colours and size that suit all of them."""
    if exaggeration is not None and not (is_number(exaggeration) and exaggeration > 0):
        raise InputError(f"exaggeration: expected a factor > 0, or none for an automatic one, got {shown(exaggeration)}")
    framed, moved, stress, force = Framed(), 0.0, [0.0], 0.0
    for instant in instants:
        contacts = None if instant.contacts is None else read(instant.contacts)
        bodies: list[DataSet] = []
        for path in (instant.blocks, instant.rigid):
            if path is None:
                continue
            data = read(path)
            displacement = np.asarray(data["displacement"])
            moved = max(moved, float(np.linalg.norm(displacement, axis=1).max(initial=0.0)))
            framed.see(data, rigid=path == instant.rigid)
            bodies.append(data)
            if "von_mises" in data.cell_data:
                stress.append(float(np.percentile(data.cell_data["von_mises"], 99)))
                stress.append(ABOVE_ROUND_OFF * float(data.field_data.get("round_off_of_stress", [0.0])[0]))  # none in files of fcsim 0.2
        framed.see_motion(bodies, contacts)
        if contacts is not None and len(reaction := np.asarray(contacts["reaction"])):
            force = max(force, float(np.linalg.norm(reaction, axis=1).max()))
    if not framed.boxes:
        raise InputError(f"{run.directory}: expected the blocks or the rigid bodies of at least one instant in vtk/, found none")
    factor = _automatic(framed.size, moved, framed.largest_factor) if exaggeration is None else float(exaggeration)
    low, high = framed.box(factor)
    planar = framed.planar
    has_stress = any(instant.blocks for instant in instants)
    last = next((instant for instant in reversed(instants) if instant.rigid is not None), None)
    return Survey(factor, (0.0, max(stress) or 1.0) if has_stress else None, force, low, high, planar, last)


def _automatic(size: float, moved: float, at_most: float = np.inf) -> float:
    """A round factor on displacements of up to `moved` [m] of a whole of that size [m]."""
    if moved <= NEGLIGIBLE * size or SHOWN_DISPLACEMENT * size <= moved:
        return 1.0
    wanted = max(1.0, min(SHOWN_DISPLACEMENT * size / moved, at_most))
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * ROUND_FACTORS[wanted / power * (1 + 1e-12) >= ROUND_FACTORS][-1])


def left_out(last: Instant, toward: NDArray[np.float64]) -> NDArray[np.int64]:
    """Numbers of the rigid bodies that pictures look past: they stand before all others, seen along the unit vector `toward` the eye."""
    assert last.rigid is not None
    return standing_before(read(last.rigid), None if last.blocks is None else read(last.blocks), toward)


def looked_past(seen: Survey, toward: NDArray[np.float64]) -> NDArray[np.int64]:
    """`left_out` of a survey; none in the plane, where nothing stands before anything, and without rigid bodies."""
    return np.empty(0, dtype=np.int64) if seen.planar or seen.last is None else left_out(seen.last, toward)


def toward_eye(seen: Survey, view: Literal["oblique", "front"] = "oblique") -> NDArray[np.float64]:
    """The unit vector (3,) to the camera of a `Scene`: the long side of the box faces it."""
    if seen.planar:
        return np.array([0.0, 0.0, 1.0])
    slant = np.array([0.27, -1.0, 0.25]) if view == "oblique" else np.array([0.0, -1.0, 0.0])
    extent = seen.high - seen.low
    toward = slant if extent[0] >= extent[1] else np.array([-slant[1], slant[0], slant[2]])
    return np.asarray(toward / np.linalg.norm(toward))


def colour_map() -> Colormap:
    """Return the colours of the stress, from 0 to the top of the range."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps[COLOUR_MAP](np.linspace(0.0, DARKEST, 256)), name="stress")


class Scene:
    """A camera on the box of a survey, and images of instants seen by it; a context manager that frees the renderer.

    view   "oblique": from the front, the right and above; "front": along the thickness. 2D models are always seen along z.
    width  of the image [pixel]; its height follows from the box
    margin free space on each side of the box, as a share of the image's width
    """

    def __init__(self, seen: Survey, view: Literal["oblique", "front"] = "oblique", width: int = 1500, margin: float = MARGIN) -> None:
        self.survey = seen
        self.toward = toward_eye(seen, view)
        up = np.array([0.0, 1.0, 0.0] if seen.planar else [0.0, 0.0, 1.0])
        right = np.cross(up, self.toward)
        self.right = right / np.linalg.norm(right)
        self.up = np.cross(self.toward, self.right)

        self.left_out = looked_past(seen, self.toward)
        self.centre = (seen.low + seen.high) / 2
        corners = np.array(np.meshgrid(*zip(seen.low, seen.high, strict=True))).reshape(3, -1).T - self.centre
        half_width, highest = (float(np.abs(corners @ axis).max()) for axis in (self.right, self.up))
        half_width /= 1 - 2 * margin
        half_height = max(highest + 2 * margin * half_width, 0.1 * half_width)
        if half_height > TALLEST * half_width:  # a tower would need a very tall image: it leaves space at its sides instead
            half_height = max(highest / (1 - 2 * margin / TALLEST), TALLEST * half_width)
        shape = min(half_height / half_width, TALLEST)
        self.width, self.height = 2 * round(width / 2), 2 * round(width * shape / 2)  # even: a film's colour blocks are 2 x 2
        self.pixel_per_metre = self.height / (2 * half_height)
        self._plotter = offscreen().Plotter(off_screen=True, window_size=(self.width, self.height), lighting="none")
        self._plotter.set_background("white")
        self._plotter.enable_anti_aliasing("ssaa")
        self._light_and_aim(half_height)
        self._plotter.show(auto_close=False)  # pyvista renders nothing before

    def __enter__(self) -> Scene:
        return self

    def __exit__(self, *error: object) -> None:
        self._plotter.close()

    def pixels(self, points: NDArray) -> NDArray[np.float64]:
        """Return where points (n, 3) [m] stand in the image: (n, 2), x to the right and y down from the upper left corner."""
        relative = np.asarray(points) - self.centre
        return np.column_stack(
            [self.width / 2 + self.pixel_per_metre * (relative @ self.right), self.height / 2 - self.pixel_per_metre * (relative @ self.up)]
        )

    def shown(self, data: DataSet) -> NDArray[np.float64]:
        """Return the points of a data set with the exaggerated displacement (n, 3) [m]; contacts are stored displaced once already."""
        times = self.survey.exaggeration - ("reaction" in data.point_data)
        return np.asarray(data.points) + times * np.asarray(data["displacement"])

    def image(self, instant: Instant, *, coloured: bool = True) -> NDArray[np.uint8]:
        """Return (height, width, 3): blocks coloured by von Mises stress with the mesh's edges, or plain; platens in grey."""
        self._plotter.clear_actors()
        if instant.rigid is not None:
            rigid = read(instant.rigid)
            if len(self.left_out):
                rigid = rigid.extract_cells(~np.isin(rigid.cell_data["body"], self.left_out)).extract_surface(algorithm="dataset_surface")
            self._add(rigid, color="#8c8c8c" if rigid.n_lines else "#c9c9c9" if coloured else "#dedede")
        if instant.blocks is not None:
            blocks = read(instant.blocks)
            colours: dict[str, object] = {"color": "#f4f1ea"}
            if coloured:
                colours = {"scalars": "von_mises", "clim": self.survey.stress, "cmap": colour_map(), "show_scalar_bar": False}
            self._add(blocks, edges=coloured, **colours)
        self._plotter.render()
        return np.asarray(self._plotter.image)

    def _add(self, data: DataSet, edges: bool = False, **colours: object) -> None:
        data.points = self.shown(data)
        surface = data.extract_surface(algorithm="dataset_surface") if hasattr(data, "celltypes") else data
        fine = self.width / 1500
        if surface.n_cells == 0:
            return
        lines = surface.n_lines > 0
        lit = not (self.survey.planar or lines)
        shade = {"ambient": 0.65, "diffuse": 0.4, "lighting": True} if lit else {"ambient": 0.0, "diffuse": 1.0, "lighting": False}
        mesh_lines = {"show_edges": True, "edge_color": "#404040", "line_width": 0.8 * fine, "edge_opacity": 0.45} if edges else {}
        self._plotter.add_mesh(surface, **(mesh_lines or {"line_width": 4 * fine}), **shade, **colours, render=False)
        outline = surface.extract_feature_edges(feature_angle=40, boundary_edges=True, non_manifold_edges=False, manifold_edges=False)
        if outline.n_cells and not lines:
            # in front of the faces that it bounds; a parallel projection shows it at the same place
            outline.points += 2e-3 * float(np.linalg.norm(self.survey.high - self.survey.low)) * self.toward
            self._plotter.add_mesh(outline, color="#202020", line_width=2.2 * fine, lighting=False, render=False)

    def _light_and_aim(self, half_height: float) -> None:
        distance = 4 * float(np.linalg.norm(self.survey.high - self.survey.low))
        camera = self._plotter.camera
        camera.focal_point, camera.position, camera.up = self.centre, self.centre + distance * self.toward, self.up
        camera.parallel_projection, camera.parallel_scale = True, half_height
        camera.clipping_range = (0.1 * distance, 3 * distance)
        direction = self.toward - 0.35 * self.right + 0.45 * self.up
        light = offscreen().Light(position=self.centre + distance * direction, focal_point=self.centre, light_type="scene light")
        light.positional = False
        self._plotter.add_light(light)
