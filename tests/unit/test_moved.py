"""Old names work for one release, and warn; each leads somewhere."""

import importlib
import sys
import warnings

import pytest

import fcsim
from fcsim import moved
from fcsim.moved import MODULES, NAMES, Moved, renamed


@pytest.mark.parametrize("old", MODULES)
def test_a_module_that_moved_is_the_same_module(old: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, old, raising=False)
    with pytest.warns(FutureWarning, match=f"{MODULES[old].to} now; the old name ends with fcsim {MODULES[old].ends}"):
        found = importlib.import_module(old)
    assert found is importlib.import_module(MODULES[old].to)
    assert found.__name__ == MODULES[old].to == getattr(found.__spec__, "name", None)


def test_a_name_that_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moved, "NAMES", {"Stuff": Moved("Material")})
    with pytest.warns(FutureWarning, match=r"fcsim\.Stuff is fcsim\.Material now"):
        assert fcsim.Stuff is fcsim.Material  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="no attribute 'Stufff'"):
        _ = fcsim.Stufff  # type: ignore[attr-defined]


def test_what_has_not_moved_does_not_warn() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert renamed("Material") == "Material"
        importlib.import_module("fcsim.mesh.solids.closed_surface")
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module("fcsim.command_line.nothing")


def test_old_names_end() -> None:
    """None is kept beyond the release that it is promised to end with."""

    def release(text: str) -> tuple[int, ...]:
        return tuple(int(part) for part in text.split("."))

    assert all(release(entry.ends) > release(fcsim.__version__) for entry in (*NAMES.values(), *MODULES.values()))


def test_shells_see_the_names_that_are_loaded_when_first_used() -> None:
    assert {*fcsim.__all__, "__version__"} <= set(dir(fcsim))


def test_a_module_in_whose_place_there_is_a_function_now_is_called_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The import of an old name puts the module into its package, over the function of that name."""
    monkeypatch.delitem(sys.modules, "fcsim.mesh.rigid_polygon", raising=False)
    with pytest.warns(FutureWarning, match="rigid_polygon now"):
        importlib.import_module("fcsim.mesh.rigid_polygon")
    assert fcsim.mesh.rigid_polygon("half", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], density=2.0).mass == pytest.approx(1.0)
