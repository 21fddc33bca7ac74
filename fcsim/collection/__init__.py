"""Collections of FCLIB problems: made from a case or a run, graded selections of them, and their verification.

    from fcsim.collection import build_collection, check_collection, read_manifest, select_problems

    build_collection("results/masonry_wall", "wall")            # wall/global, wall/local, manifest.csv, README.md, plots
    select_problems("wall", "wall50", count=50)                 # graded difficulty, spread over time
    compose_collection("cases/nonlinear.json", "nonlinear")     # several cases run, 50 problems of them
    failed = [row for row in check_collection("wall50") if row.failures]

The names are loaded when first used: selecting and checking need neither dolfinx nor gmsh.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fcsim.collection.build import Built, build_collection
    from fcsim.collection.check import Checked, check_collection
    from fcsim.collection.compose import Recipe, compose_collection, read_recipe
    from fcsim.collection.grade import choose
    from fcsim.collection.manifest import Entry, read_manifest, write_manifest
    from fcsim.collection.properties import Properties, properties
    from fcsim.collection.select import Selection, select_problems

_HOME = {
    "Built": "build",
    "Checked": "check",
    "Entry": "manifest",
    "Properties": "properties",
    "Recipe": "compose",
    "Selection": "select",
    "build_collection": "build",
    "check_collection": "check",
    "choose": "grade",
    "compose_collection": "compose",
    "properties": "properties",
    "read_manifest": "manifest",
    "read_recipe": "compose",
    "select_problems": "select",
    "write_manifest": "manifest",
}

__all__ = [
    "Built",
    "Checked",
    "Entry",
    "Properties",
    "Recipe",
    "Selection",
    "build_collection",
    "check_collection",
    "choose",
    "compose_collection",
    "properties",
    "read_manifest",
    "read_recipe",
    "select_problems",
    "write_manifest",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'fcsim.collection' has no attribute {name!r}")
    return getattr(import_module(f"fcsim.collection.{_HOME[name]}"), name)
