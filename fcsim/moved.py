"""Names and modules that have moved: for one release the old ones still work and warn, and this is the one place that knows them.

A name of `fcsim` that is renamed goes into NAMES, a module that moves into MODULES, each with the release that forgets it. The warning is a
FutureWarning, which Python shows to those who run a script, and not only to those who wrote it.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType


@dataclass(frozen=True)
class Moved:
    """Where something is now, and the release in which its old name ends."""

    to: str
    ends: str = "0.3.0"


NAMES: Mapping[str, Moved] = {}
"""Names of `fcsim` that have another one now."""

MODULES: Mapping[str, Moved] = {
    "fcsim.command_line.bench": Moved("fcsim.command_line.sets.bench"),
    "fcsim.command_line.collection": Moved("fcsim.command_line.sets.collection"),
    "fcsim.command_line.profile": Moved("fcsim.command_line.sets.profile"),
    "fcsim.contact_detection.general.overlaps": Moved("fcsim.contact_detection.general.overlap.overlaps"),
    "fcsim.masonry.branch": Moved("fcsim.masonry.histories.branch"),
    "fcsim.masonry.shake": Moved("fcsim.masonry.histories.shake"),
    "fcsim.mesh.material.orthotropic": Moved("fcsim.mesh.material.linear"),
    "fcsim.mesh.closed_surface": Moved("fcsim.mesh.solids.closed_surface"),
    "fcsim.mesh.rigid_polygon": Moved("fcsim.mesh.solids.rigid_polygon"),
    "fcsim.running.own_files": Moved("fcsim.running.refusals.own_files"),
    "fcsim.running.size": Moved("fcsim.running.refusals.size"),
    "fcsim.timestep.first_half": Moved("fcsim.timestep.beginning.first_half"),
    "fcsim.timestep.step_equation.mixing": Moved("fcsim.timestep.step_equation.loops.mixing"),
    "fcsim.timestep.warm_start": Moved("fcsim.timestep.reactions.warm_start"),
    "fcsim.view.page.surface": Moved("fcsim.view.joints.surface"),
}
"""Modules of 0.1.0 and 0.2.0 that lie elsewhere now."""


def renamed(name: str, names: Mapping[str, Moved] | None = None) -> str:
    """The name itself, or with a warning the one that took its place."""
    moved = (NAMES if names is None else names).get(name)
    if moved is None:
        return name
    _warn(f"fcsim.{name}", Moved(f"fcsim.{moved.to}", moved.ends))
    return moved.to


def _warn(old: str, moved: Moved) -> None:
    warnings.warn(f"{old} is {moved.to} now; the old name ends with fcsim {moved.ends}", FutureWarning, stacklevel=3)


class _Callable(ModuleType):
    """A module that, called, is its function of the same name."""

    def __call__(self, *args: object, **options: object) -> object:
        function: Callable[..., object] = getattr(self, self.__name__.rpartition(".")[2])
        return function(*args, **options)


class _Elsewhere(MetaPathFinder, Loader):
    """Finds modules of MODULES where they lie now; asked after all others, so that it costs nothing where nothing has moved."""

    def __init__(self) -> None:
        self._specs: dict[str, ModuleSpec | None] = {}

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """A spec of the old name."""
        moved = MODULES.get(fullname)
        if moved is None:
            return None
        _warn(fullname, moved)
        return ModuleSpec(fullname, self)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module that lies elsewhere: one and the same, with its own spec, which the import of the old name would replace."""
        module = import_module(MODULES[spec.name].to)
        package, _, name = spec.name.rpartition(".")
        if callable(getattr(import_module(package), name, None)):  # a function of the package, in whose place the import puts the module
            module.__class__ = _Callable
        self._specs[spec.name] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing: it has been executed under its own name, which it keeps."""
        for old, spec in self._specs.items():
            if MODULES[old].to == module.__name__:
                module.__spec__ = spec


def watch_imports() -> None:
    """Let old names of modules be found, once for the process."""
    if not any(isinstance(finder, _Elsewhere) for finder in sys.meta_path):
        sys.meta_path.append(_Elsewhere())
