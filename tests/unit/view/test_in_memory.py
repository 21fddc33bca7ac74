"""Pictures and pages of steps in memory: of a made-up step, and of a real run."""

import io
import json
import re

import numpy as np
import pytest
from PIL import Image

from fcsim import Body, Everything, Material, Simulation, Support, Theta, build_model
from fcsim.errors import InputError
from fcsim.mesh import rectangle, rigid_rectangle
from fcsim.view import interactive, picture


@pytest.fixture(scope="module")
def made(fake):
    model = fake.wall(divisions=4)

    def step(number):
        of = fake.step(model, number, 4, divisions=4)
        of.model = model
        return of

    return step


def image(drawn):
    return np.asarray(Image.open(io.BytesIO(drawn.png)).convert("RGB"))


def test_a_step_is_drawn_and_saved_whole(made, tmp_path):
    drawn = picture(made(4), title="A wall")
    pixels = image(drawn)
    assert pixels.shape[1] >= 1200 and pixels.std() > 12
    assert drawn._repr_png_() == drawn.png and "png" in repr(drawn)
    path = drawn.save(tmp_path / "new" / "wall.png")
    assert path.read_bytes() == drawn.png and [file.name for file in path.parent.iterdir()] == ["wall.png"]
    with pytest.raises(InputError, match=r"path: expected the name of a \.png file"):
        drawn.save(tmp_path / "wall.jpg")


@pytest.mark.slow
def test_contacts_and_several_steps(made):
    assert image(picture(made(4), what="contacts", view="front")).std() > 8
    four = image(picture(made(3), made(1), made(2), made(4), made(4)))  # the order of time, each once
    assert four.shape[0] < 1.3 * four.shape[1]


def test_what_cannot_be_meant_is_refused(made, fake):
    for wrong, said in (
        ({"what": "strain"}, "what: expected one of 'stress', 'contacts', got 'strain'"),
        ({"view": "above"}, "view: expected one of 'oblique', 'front'"),
        ({"exaggeration": -1.0}, "exaggeration: expected a factor > 0"),
    ):
        with pytest.raises(InputError, match=said):
            picture(made(1), **wrong)
    for steps in ((), ([made(1)],), (None,)):
        with pytest.raises(InputError, match="expected one or more steps of a Simulation"):
            picture(*steps)
    other = fake.step(fake.wall(divisions=4), 1, 4, divisions=4)
    other.model = object()
    with pytest.raises(InputError, match="steps of one model"):
        picture(made(1), other)
    with pytest.raises(InputError, match="one step for a picture of its contacts, got 2"):
        picture(made(1), made(2), what="contacts")


@pytest.mark.slow
def test_a_run_in_millimetres_is_a_page_with_its_steps():
    """A block of 20 x 10 mm in units of mm, t, s: the page has every instant, the row of each step and no address."""
    steel = Material(E=2.1e5, nu=0.3, density=7.8e-9)
    block = rectangle("block", (20.0, 10.0), (4, 2), steel)
    floor = rigid_rectangle("floor", (60.0, 5.0), (10.0, -2.5), 1.0)
    model = build_model(
        [floor, Body("block", block)], supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, -9810.0), beta=1e-6
    )
    steps = list(Simulation(model, Everything(model, mu=0.3), Theta(h=1e-5), steps=4))
    made = interactive(*steps[::2], title="A <block>")
    content = json.loads(re.search(r'<script type="application/json" id="content">(.*?)</script>', made.html, re.DOTALL)[1])
    assert content["bodies"] == ["block", "floor"] and content["title"] == "A <block>"
    assert [float(t) for t in content["columns"]["t"]] == pytest.approx([1e-5, 3e-5])
    assert made._repr_html_().startswith("<iframe ") and "A &lt;block&gt;" in made.html
    assert image(picture(steps[-1])).std() > 8
