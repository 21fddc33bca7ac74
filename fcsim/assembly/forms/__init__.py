"""From dolfinx: parts of its meshes, the UFL forms of a part, forms of one's own as loads."""

from fcsim.assembly.forms.part_forms import PartForms, forms_of
from fcsim.assembly.forms.part_of_mesh import part_from_dolfinx

__all__ = ["PartForms", "forms_of", "part_from_dolfinx"]
