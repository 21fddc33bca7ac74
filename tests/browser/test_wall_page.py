"""The page of the reference wall with all of its 500 instants: its size, the main thread's own time until it is seen, and of moving.

Thread time, which does not depend on what else the machine does; the run takes a minute.
"""

import pytest

from fcsim.running.case import load_case
from fcsim.running.outputs import RunOptions
from fcsim.running.run import run_case
from fcsim.view import render

pytestmark = [pytest.mark.browser, pytest.mark.slow]
MOVES = """async count => {
    const slider = document.getElementById("instant"), last = +slider.max;
    for (let k = 0; k <= count; k++) {
        slider.value = Math.round(k * last / count);
        slider.dispatchEvent(new Event("input"));
        await new Promise(drawn => requestAnimationFrame(() => setTimeout(drawn)));
    }
}"""


@pytest.fixture(scope="module")
def page_of_the_wall(tmp_path_factory):
    directory = tmp_path_factory.mktemp("wall") / "wall"
    run_case(load_case("cases/masonry_wall"), {}, directory, RunOptions(export_every=0, vtk_every=1))
    render(directory, film=None, page=True)
    return directory / "page.html"


def test_it_is_small(page_of_the_wall):
    assert page_of_the_wall.stat().st_size <= 15e6


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (390, 844)])
def test_it_is_seen_soon_and_moves_smoothly(browser, page_of_the_wall, width, height):
    """3 s until the bodies are drawn, and less than 100 ms a move of the slider, which is ten pictures a second."""
    page = browser.new_page(viewport={"width": width, "height": height})
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def seconds():
        return next(metric["value"] for metric in session.send("Performance.getMetrics")["metrics"] if metric["name"] == "TaskDuration")

    page.goto(page_of_the_wall.as_uri())
    page.wait_for_function("performance.getEntriesByName('first picture').length > 0", timeout=120_000, polling=20)
    assert seconds() < 3.0
    page.wait_for_selector("html[data-ready]", timeout=120_000)
    assert int(page.get_attribute("#instant", "max")) == 499
    begin, count = seconds(), 20
    page.evaluate(MOVES, count)
    assert (seconds() - begin) / count < 0.1
    page.close()
