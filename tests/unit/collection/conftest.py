"""A collection of three steps of a small wall, made once, and copies of it to damage."""

import shutil
from pathlib import Path

import pytest

from fcsim.collection import Built, build_collection

ROOT = Path(__file__).parents[3]
WALL = ROOT / "cases" / "masonry_wall"
SMALL = {"courses": "1", "blocks": "2", "divisions": "2,1,1", "steps": "3"}


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Two blocks of 2 x 1 x 1 elements between the platens, steps 1 to 3; tests only read it."""
    return build_collection(WALL, tmp_path_factory.mktemp("built") / "wall", assignments=SMALL, authors="A. Mason")


@pytest.fixture
def copy(built: Built, tmp_path: Path) -> Path:
    """A copy of the collection, to be damaged."""
    return Path(shutil.copytree(built.directory, tmp_path / "copy"))
