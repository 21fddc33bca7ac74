"""What contacts hold, written down: for tests of the rules of `auto` on states that are no problem's."""

from __future__ import annotations

import pytest


@pytest.fixture
def what_is_held_is_written_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contacts hold what the state says, and have a compliance where it says so."""
    monkeypatch.setattr("fcsim.solvers.automatic.closed.held", lambda race: race.holds)
    monkeypatch.setattr("fcsim.solvers.automatic.closed.regular", lambda race: race.regular)
