"""A run is not resumed with other elements than it began with."""

from fcsim.assembly import build_model
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.running.resume import model_digest


def test_other_elements_are_another_model() -> None:
    def digest(elements: str | None) -> str:
        return model_digest(build_model([Body("b", rectangle("r", (1.0, 1.0), (2, 2), Material(1e9, 0.3, 1e3), elements=elements))]))

    assert digest(None) == digest("Q1")
    assert len({digest("Q1"), digest("Q1-enhanced"), digest("Q1-bbar")}) == 3
