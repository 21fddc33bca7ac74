"""DIR/page.html: the run as one file."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from fcsim.errors import MissingDependency
from fcsim.files import inside, replacing
from fcsim.running.folder import RunFolder
from fcsim.view.joints.draw import crack_colours
from fcsim.view.page.curves import drawn, graphs, shown_rows, table, units
from fcsim.view.page.motion import motion
from fcsim.view.scene import Survey, colour_map, left_out
from fcsim.view.style import matplotlib

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

LOOK = 1000
"""[pixels] Length and height at most of the picture that is seen first."""

SCRIPTS = ("numbers", "space", "curves", "page")
"""One after the other, as the page has them."""


def write_page(run: RunFolder, seen: Survey | None, progress: Callable[[int, int], None] = lambda done, total: None) -> Path:
    """Write DIR/page.html and return its path: bodies, contacts and forces over time in space, curves, parameters, versions, all within.

    seen: see `fcsim.view.scene.survey`; None where the run wrote no VTK series: the page has curves and tables alone.
    Raises MissingDependency without plotly, InputError where a file of the run cannot be read.
    """
    path = inside(run.directory, run.directory / "page.html")
    rows = shown_rows(run)
    about = run.description
    facts = {
        "status": about.status + (f": {about.message}" if about.message else ""),
        "steps": f"{about.steps_done if about.steps_done is not None else '?'} of {about.steps}",
        "h": None if about.h is None else f"{about.h:g} s",
        "scheme": about.scheme,
        "solver": f"{about.solver}, tol {about.tol:g}" if about.tol is not None else about.solver,
        "largest overlap": f"{about.overlap.depth:.3g} m {about.overlap.between}" if about.overlap.depth else "none seen",
        **{f"note {k}": note for k, note in enumerate(about.notes, 1)},
    }
    content = {
        "title": run.title,
        "bodies": list(about.bodies),
        "facts": {name: value for name, value in facts.items() if value},
        "parameters": {name: str(value) for name, value in about.parameters.items()},
        "versions": dict(about.versions),
        "exaggeration": 1.0 if seen is None else seen.exaggeration,
        "planar": seen is not None and seen.planar,
        "low": None if seen is None else seen.low.tolist(),
        "high": None if seen is None else seen.high.tolist(),
        "colours": _colours(colour_map()),
        "cracks": _colours(crack_colours()),
        "stress": None if seen is None or seen.stress is None else seen.stress[1],
        "left_out": [] if seen is None else _standing_before(seen),
        "motion": motion(run, run.instants, progress, seen.planar) if seen is not None else None,
        "columns": table(run, rows),
        "units": units(run),
        "graphs": [drawn(graph) for graph in graphs(run, rows)],
    }
    here = files("fcsim.view.page")
    text = Template(here.joinpath("page.html").read_text(encoding="utf-8")).substitute(
        title=escape(run.title),
        status=escape(about.status or "unknown"),
        description=escape(about.description),
        look=_first_look(run) if seen is not None else "",
        style=here.joinpath("page.css").read_text(encoding="utf-8"),
        script="\n".join(here.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS),
        arrays=here.joinpath("arrays.js").read_text(encoding="utf-8"),
        library=library(),
        content=as_json(content),
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _first_look(run: RunFolder) -> str:
    """The run's own picture of its last instant as a style of the scene's place, seen until the bodies are drawn; "" where it has none."""
    try:
        from PIL import Image
    except ImportError as error:
        raise MissingDependency(f"Pillow cannot be imported ({error}), which a run's page needs: pip install 'fcsim[view]'") from None
    pictures = (inside(run.directory, run.directory / "pictures") / name for name in ("stress.png", "bodies.png"))
    for path in pictures:
        if path.is_file():
            with Image.open(path) as picture:
                picture.thumbnail((LOOK, LOOK))
                packed = BytesIO()
                picture.convert("RGB").save(packed, "JPEG", quality=75)
            return f"background-image: url(data:image/jpeg;base64,{b64encode(packed.getvalue()).decode('ascii')})"
    return ""


def _standing_before(seen: Survey) -> list[int]:
    """Bodies that hide all others from where the page looks at first, which it does not show until asked."""
    extent = seen.high - seen.low
    if seen.planar or seen.last is None:
        return []
    toward = np.array([0.3, -1.15, 0.28]) if extent[0] >= extent[1] else np.array([1.15, 0.3, 0.28])  # the eye of space.js
    return [int(number) for number in left_out(seen.last, toward / np.linalg.norm(toward))]


def _colours(of_picture: Colormap) -> list[tuple[float, str]]:
    """Colours as in pictures: (share of the range, colour) from 0 to 1."""
    to_hex = matplotlib().colors.to_hex
    return [(float(share), to_hex(of_picture(share))) for share in np.linspace(0.0, 1.0, 11)]


def as_json(content: object) -> str:
    """JSON as the content of a script, which no "</script" within ends."""
    return json.dumps(content, allow_nan=False).replace("<", "\\u003c")


def library() -> str:
    """plotly.js, which comes with plotly's package, as the content of a script."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise MissingDependency(f"plotly cannot be imported ({error}), which a run's page needs: pip install 'fcsim[view]'") from None
    return str(get_plotlyjs()).replace("</script", "<\\/script")
