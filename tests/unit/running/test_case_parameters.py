"""Parameters that the cases cannot be built with: one clear error each."""

from pathlib import Path
from typing import Any

import pytest

from fcsim.errors import InputError
from fcsim.running.case import load_case

CASES = Path(__file__).parents[3] / "cases"


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("hertz", {"approach": -1e-4}, "approach: expected a length between 0 and a quarter of the radius 0.05 m, got -0.0001"),
        ("hertz", {"approach": 0.02, "contact": "cylinder"}, "approach: expected a length between 0 and a quarter of the radius"),
        ("hertz", {"core": 0.9}, "core: expected at least 1.1 contact radii, got 0.9"),
        ("hertz", {"divisions": 0}, "divisions: expected a whole number >= 1, got 0"),
        ("hertz", {"steps": -1}, "steps: expected a whole number >= 0, got -1"),
        ("cattaneo_mindlin", {"mu": 0.0}, "mu: expected a friction coefficient > 0, got 0.0"),
        ("cattaneo_mindlin", {"core": 1.0}, "core: expected at least 1.1 contact radii, got 1.0"),
        ("cattaneo_mindlin", {"contact_radius": 0.0}, "expected 0 < core < radius in m, got core 0.0"),
        ("two_cubes", {"elements": 0}, "divisions: expected whole numbers >= 1, got"),
    ],
)
def test_refused(name: str, parameters: dict[str, Any], message: str) -> None:
    script = load_case(CASES / name)
    given = {"divisions": 2, **parameters} if name != "two_cubes" else parameters
    with pytest.raises(InputError, match=message):
        script.build(script.parameters(**given))


@pytest.mark.parametrize("name", ["hertz", "cattaneo_mindlin", "two_cubes"])
def test_no_steps_are_no_error(name: str) -> None:
    script = load_case(CASES / name)
    assert list(script.build(script.parameters(steps=0)).simulation) == []


@pytest.mark.parametrize(("name", "value"), [("n", 2**55), ("width", 1e300), ("radius", 1e-20)])
def test_models_that_no_memory_holds(name: str, value: float) -> None:
    """The errors of memory and of NumPy's sizes within a script are the parameters' fault."""
    script = load_case(CASES / "granular")
    with pytest.raises(InputError, match=r"'granular': expected parameters that its script can compute with: "):
        script.build(script.parameters(**{name: value}))
