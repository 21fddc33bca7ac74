"""What `ExactContacts` keeps of the last configurations: contacts are those of the positions that are asked for."""

import numpy as np

from fcsim import ExactContacts, build_model
from fcsim.mesh import rigid_capsule, rigid_sphere


def test_contacts_follow_positions_that_change_in_their_place() -> None:
    """Gaps are those of what the array says now and of a detection that was never asked, and the first ones again where it says that."""
    model = build_model([rigid_sphere("a", 0.1, (0, 0, 0.2), 1.0), rigid_capsule("b", 0.05, 0.2, (0, 0, 0.04), 1.0, axis=(1, 0, 0))])
    asked, x = ExactContacts(model, 0.3, alert=0.5), model.reference.copy()
    up = np.zeros(x.shape)
    up[asked.solids.node[0]] = (0, 0, 0.01)
    gaps = []
    for _ in range(5):
        found, fresh = asked(x), ExactContacts(model, 0.3, alert=0.5)(x)
        assert np.array_equal(found.gap, fresh.gap) and np.array_equal(found.weights, fresh.weights)
        gaps.append(float(found.gap[0]))
        x += up
    np.testing.assert_allclose(gaps, 0.01 + 0.01 * np.arange(5), rtol=1e-12)
    for _ in range(2):  # made anew, then kept
        assert asked(model.reference).gap[0] == asked(model.reference, up).gap[0] == gaps[0]
