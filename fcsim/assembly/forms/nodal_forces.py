"""Nodal forces of what dolfinx users have: linear forms, of the part's test function or of their own, and functions on their own mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fcsim import runtime
from fcsim.arrays import FloatArray
from fcsim.assembly.forms.part_forms import PartForms, forms_of
from fcsim.assembly.forms.part_of_mesh import own_mesh
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part

if TYPE_CHECKING:
    from dolfinx.fem import Function, FunctionSpace
    from ufl import Form


def form_forces(part: Part, form: Form | Callable[[PartForms], Form], what: str) -> FloatArray:
    """Nodal forces (nn, d) [N] in the part's axes of a linear form; InputError for what is no such form.

    The form's one argument is the test function of the part's `PartForms`, or of a space of vectors of the cells' order on the dolfinx
    mesh that the part was made of; forms of more arguments would be assembled beyond the bounds of their vector.
    """
    import ufl

    try:
        written = form if isinstance(form, ufl.Form) else form(forms_of(part))
        if not isinstance(written, ufl.Form):
            raise InputError(f"{what}: expected a linear form of v in UFL, got an object of class {type(written).__name__}")
        arguments = written.arguments()
        if len(arguments) != 1:
            raise InputError(
                f"{what}: expected a linear form of v in UFL, got a form of {len(arguments)} arguments (a test function v alone is one)"
            )
        space = arguments[0].ufl_function_space()
        if space is forms_of(part).space:
            forces = forms_of(part).vector(written).reshape(-1, part.dimension)
        else:
            _refuse_other_space(part, space, what)
            fem = runtime.dolfinx().fem
            forces = part.thickness * _on_nodes(space, fem.assemble_vector(runtime.compiled_form(written)).array, part)
    except InputError:
        raise
    except Exception as error:  # whatever UFL, FFCx and the user's function raise
        raise InputError(f"{what}: expected a linear form of v in UFL, got: {type(error).__name__}: {error}") from None
    if not np.all(np.isfinite(forces)):
        raise InputError(f"{what}: expected finite nodal forces, got NaN or infinity")
    return forces


def given_forces(part: Part, forces: ArrayLike | Function, what: str) -> FloatArray:
    """Nodal forces (nn, d) [N] of an array of that shape, or of a function whose degrees of freedom they are, on the mesh that the part
    was made of; InputError for others, among them bare vectors of dolfinx, whose numbers are those of a space that they do not name."""
    space = getattr(forces, "function_space", None)
    if space is not None:
        _refuse_other_space(part, space, what)
        values = _on_nodes(space, forces.x.array, part)  # type: ignore[union-attr] # a Function
    else:
        try:
            values = np.asarray(forces, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"{what}: expected an array of shape {part.points.shape}, a row a node of its part, or a dolfinx Function whose values "
                f"they are (the entries of a bare vector are in the order of its space), got an object of class {type(forces).__name__}"
            ) from None
    if values.shape != part.points.shape or not np.all(np.isfinite(values)):
        raise InputError(f"{what}: expected finite forces of shape {part.points.shape}, a row a node of its part, got {values.shape}")
    return values


def _refuse_other_space(part: Part, space: FunctionSpace, what: str) -> None:
    """InputError for a space whose degrees of freedom are not the part's nodes."""
    import basix.ufl

    cell, mesh = CELL_TYPES[part.cell_type], own_mesh(part)
    wanted = basix.ufl.element("Lagrange", cell.basix, cell.order, shape=(part.dimension,), dtype=np.float64)
    if mesh is None or space.mesh is not mesh or space.ufl_element() != wanted:
        which = "that it was made of" if mesh is not None else "(this part has none of its own)"
        where = "it" if mesh is not None and space.mesh is mesh else "another mesh"
        raise InputError(
            f"{what}: expected a function of forms_of(part), or of the space ('Lagrange', {cell.order}, ({part.dimension},)) on the "
            f"dolfinx mesh {which}, got one of {space.ufl_element()} on {where}"
        )


def _on_nodes(space: FunctionSpace, values: FloatArray, part: Part) -> FloatArray:
    """Values (nn, d) by the part's nodes, which are those of the mesh, of the degrees of freedom of a space of its order."""
    found = np.zeros_like(part.points)
    found[space.mesh.geometry.dofmaps[0]] = values.reshape(-1, part.dimension)[space.dofmap.list]
    return found
