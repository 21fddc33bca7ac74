"""Several materials in one part: its cells belong to named regions, and each has a material of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from fcsim.brief import by_fields
from fcsim.errors import InputError
from fcsim.mesh.material.law import AnyMaterial, LinearLaw, LinearMaterial, PointLaw


@dataclass(frozen=True, eq=False)
class ByRegion:
    """materials by the names of the part's regions (`Part.regions`; of a mesh file its named volumes). Cells of two regions that share
    nodes are
    bonded. Where all materials are linear, so is the body; else linear ones are taken as laws of points."""

    materials: Mapping[str, AnyMaterial]

    def __post_init__(self) -> None:
        if not self.materials:
            raise InputError("ByRegion: expected at least one material by the name of its region")
        for name, material in self.materials.items():
            if not isinstance(material, LinearMaterial | PointLaw):
                raise InputError(f"ByRegion, region {name!r}: expected a material, got {type(material).__name__}")
        object.__setattr__(self, "materials", MappingProxyType(dict(self.materials)))

    __reduce__ = by_fields


def is_linear(material: AnyMaterial | ByRegion) -> bool:
    """Whether a body of the material has one stiffness for all its life."""
    if isinstance(material, ByRegion):
        return all(map(is_linear, material.materials.values()))
    return isinstance(material, LinearMaterial)


def as_law(material: AnyMaterial) -> PointLaw:
    """The material as a law of points."""
    return material if isinstance(material, PointLaw) else LinearLaw(material)
