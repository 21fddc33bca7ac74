"""The pages of the API reference: one a room with a face (`__all__`), every public name of it described once, in the room that owns it."""

import inspect
from importlib import import_module
from pathlib import Path

from plain_docstrings import converted

SOURCE = Path(__file__).resolve().parents[2] / "fcsim"


def faces():
    """Names of the packages that declare public names, fcsim itself first."""
    found = [path.parent for path in sorted(SOURCE.rglob("__init__.py")) if "__all__" in path.read_text(encoding="utf-8")]
    return [".".join(("fcsim", *folder.relative_to(SOURCE).parts)) for folder in sorted(found)]


def described_in(known):
    """{(face, name): (face, name) of the place that describes it}: the first room that offers the same object; fcsim itself comes last."""
    owners, places = {}, {}
    for face in [*known[1:], known[0]]:
        for name in import_module(face).__all__:
            value = getattr(import_module(face), name)
            key = id(value) if callable(value) or inspect.ismodule(value) else (face, name)
            owners.setdefault(key, (face, name, value))  # the value is kept, so that no other object takes its id
            places[face, name] = owners[key][:2]
    return places


def directive(face, name):
    """The lines that describe one public name by its docstring and signature."""
    value = getattr(import_module(face), name)
    if inspect.isclass(value):
        kind, options = "autoclass", ["   :members:", "   :inherited-members: Exception,object,Protocol,Enum,dict,tuple,str,int"]
    elif inspect.isfunction(value) or inspect.isbuiltin(value):
        kind, options = "autofunction", []
    elif inspect.ismodule(value):
        return [f".. py:module:: {value.__name__}", "   :no-index:", "", *converted(inspect.cleandoc(value.__doc__ or "").splitlines())]
    else:
        kind, options = "autodata", ["   :no-value:"]
    return [f".. {kind}:: {face}.{name}", *options, ""]


def page(face, places):
    """The page of one room as reStructuredText."""
    module = import_module(face)
    lines = [f".. _api-{face}:", "", face, "=" * len(face), "", *converted(inspect.cleandoc(module.__doc__ or "").splitlines())]
    own = [name for name in module.__all__ if places[face, name] == (face, name)]
    others = [name for name in module.__all__ if name not in own]
    if others:
        lines += [".. list-table::", "   :header-rows: 1", "", "   * - name", "     - described in"]
        for name in others:
            home, there = places[face, name]
            lines += [f"   * - :py:obj:`{name} <{home}.{there}>`", f"     - :ref:`{home} <api-{home}>`"]
        lines += [""]
    for name in own:
        lines += [name, "-" * len(name), "", *directive(face, name)]
    return "\n".join(lines) + "\n"


def pages():
    """{file name: text} of the whole reference."""
    known = faces()
    places = described_in(known)
    result = {f"{face}.rst": page(face, places) for face in known}
    listed = "\n".join(f"   {face}" for face in known)
    counted = sum(len(import_module(face).__all__) for face in known)
    result["index.rst"] = (
        "API reference\n=============\n\n"
        f"All {counted} public names of the {len(known)} packages that have a face (``__all__``). Signatures and descriptions are those of the code;\n"
        "shapes, units and errors stand in the descriptions. Most scripts need :ref:`fcsim <api-fcsim>` and :ref:`fcsim.mesh <api-fcsim.mesh>` only.\n\n"
        f".. toctree::\n   :maxdepth: 1\n\n{listed}\n"
    )
    return result
