"""The picture of the contacts: its reactions beside what else stands on the page."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from fcsim.contact_detection.contacts import Contacts
from fcsim.mesh.part import RigidBody
from fcsim.running.description import Description
from fcsim.running.folder import RunFolder, instants_in
from fcsim.view import SeriesWriter, pictures, scene


@pytest.mark.parametrize(("length", "height"), [(20.0, 0.2), (1.0, 1.0), (0.2, 20.0)])
def test_reactions_at_the_edges_end_within_the_picture(fake, tmp_path, length, height):
    """Those of flat models ran through the line under the title, and those of towers over the page's edge."""
    points = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [length, height]
    block = RigidBody("block", 1.0, np.eye(1), points.mean(0), points, {"all": [(0, 1), (1, 2), (2, 3), (3, 0)]})
    model = fake.model((block,))
    edges = np.concatenate([points, (points + np.roll(points, 1, axis=0)) / 2])
    step = fake.step(fake.wall(2, 4), 1, 1, 4)
    some = {name: getattr(step.contacts, name)[: len(edges)] for name in ("frame", "gap", "mu", "nodes", "weights", "bodies", "identity")}
    for axis in (0, 1, 2):  # in 2 all are free of forces
        force = np.zeros((len(edges), 3))
        force[:, axis] = 5.0
        force = force[:, :2]
        made = SimpleNamespace(**vars(step) | {"model": model, "contact_force": force, "contact_status": np.ones(len(edges), np.int8)})
        made.state = SimpleNamespace(t=1.0, x=np.zeros(8), v=np.zeros(8))
        made.contacts = Contacts(point=edges, **some | {"nodes": np.zeros_like(some["nodes"])})
        made.result = SimpleNamespace(u=np.zeros(2 * len(edges)))
        folder = tmp_path / f"run{axis}"
        SeriesWriter(folder / "vtk", model).write(made)
        run = RunFolder(folder, Description(title="Block"), {}, instants_in(folder / "vtk"))
        with scene.Scene(scene.survey(run, run.instants), "front", width=600, margin=pictures.ROOM) as view:
            axes = (drawing := pictures.contact_figure(run, view, run.instants[0])).axes[0]
            ends = np.concatenate(next(c for c in axes.collections if isinstance(c, LineCollection)).get_segments())
        said = [text.get_text() for legend in drawing.legends for text in legend.get_texts()]
        assert said[-1] == ("reaction (none in the run)" if axis == 2 else "reaction (longest of the run: 5 N)")
        assert len(ends) == 2 * len(edges)
        assert (ends >= 0.0).all() and (ends <= [view.width, view.height]).all()
