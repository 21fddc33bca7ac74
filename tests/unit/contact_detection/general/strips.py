"""Bodies that fold, swept along a line: U-shaped springs, split rings, hollow sections; in 2D of quadrilaterals, in 3D of hexahedra."""

import numpy as np

from fcsim.mesh.material import Material
from fcsim.mesh.part import Part


def strip(
    name: str, line: np.ndarray, across: np.ndarray, thickness: float, layers: int, material: Material, *, closed: bool = False,
    width: float | None = None, **options
) -> Part:  # fmt: skip
    """A strip of `thickness` about a line (n, 2) with unit vectors `across` it (n, 2), to its left; width: extruded along z, one cell.

    Surfaces: "begin" and "end" (not of a closed line), "left", "right".
    """
    share = (np.arange(layers + 1) / layers - 0.5) * thickness
    points = (line[:, None] + share[None, :, None] * across[:, None]).reshape(-1, 2)
    number = np.arange(len(points)).reshape(len(line), layers + 1)
    if closed:
        number = np.vstack([number, number[:1]])
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    sides = {
        "right": np.stack([number[:-1, 0], number[1:, 0]], axis=1),
        "left": np.stack([number[1:, -1], number[:-1, -1]], axis=1),
    }
    if not closed:
        sides |= {
            "begin": np.stack([number[0, 1:], number[0, :-1]], axis=1),
            "end": np.stack([number[-1, :-1], number[-1, 1:]], axis=1),
        }
    return _part(name, points, cells, sides, material, width, **options)


def arc(radius: float, begin: float, end: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """n + 1 points of an arc from the angle begin to end [rad], counter-clockwise, and unit vectors to its left, inwards."""
    angle = np.linspace(begin, end, n + 1)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    return radius * out, -out


def fork(material: Material, length: float, leg: float, gap: float, n: int, layers: int, **options) -> Part:
    """Two legs along x, `gap` apart, on a base of thickness 4 in x < 0: the base's and the legs' nodes are those of one mesh."""
    t = leg
    y = np.concatenate([np.linspace(-gap / 2 - t, -gap / 2, layers + 1), np.linspace(gap / 2, gap / 2 + t, layers + 1)])
    x = np.concatenate([np.linspace(-4 * t, 0, 5)[:-1], np.linspace(0, length, n + 1)])
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(len(x), len(y))
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    keep = np.ones(cells.shape[:2], dtype=bool)
    keep[4:, layers] = False  # the slot
    if gap == 0:  # a crack: two rows of nodes, of which the base has one
        number[:5, layers + 1] = number[:5, layers]
        cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
        keep[:, layers] = False
    used, renumbered = np.unique(cells[keep], return_inverse=True)
    where = np.full(len(points), -1)
    where[used] = np.arange(len(used))
    low, high = where[number[-1, : layers + 1]], where[number[-1, layers + 1 :]]
    rim = np.concatenate([number[0, ::-1], number[1:5, 0], number[4, layers : layers + 2]])  # the root between the legs too
    top = where[number[4::-1, -1]]
    base = np.concatenate([np.stack([where[rim[:-1]], where[rim[1:]]], axis=1), np.stack([top[:-1], top[1:]], axis=1)])
    base = np.delete(base, len(rim) - 3, axis=0)
    surfaces = {
        "lower tip": np.stack([low[:-1], low[1:]], axis=1),
        "upper tip": np.stack([high[:-1], high[1:]], axis=1),
        "base": base,
    }
    return Part("fork", points[used], renumbered.reshape(-1, 4), "quadrilateral", surfaces, material, **options)


def hollow(material: Material, length: float, plate: float, gap: float, width: float | None, **options) -> Part:
    """Two plates along x, `gap` apart, between webs of a twentieth of the length each; surfaces "up", "down" in the plates' middles over
    a twentieth of the length, "webs" outside; width: extruded along z, one cell."""
    n, t = 40, plate
    x, y = np.linspace(0, length, n + 1), np.concatenate([np.linspace(-gap / 2 - t, -gap / 2, 3), np.linspace(gap / 2, gap / 2 + t, 3)])
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(n + 1, 6)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    keep = np.ones(cells.shape[:2], dtype=bool)
    keep[2:-2, 2] = False
    left = np.concatenate([number[2:0:-1, 5], number[0, ::-1], number[1:3, 0]])
    right = np.concatenate([number[-3:-1, 0], number[-1], number[-2:-4:-1, 5]])
    middle = number[n // 2 - 1 : n // 2 + 2]
    sides = {
        "up": np.stack([middle[1:, 5], middle[:-1, 5]], axis=1),
        "down": np.stack([middle[:-1, 0], middle[1:, 0]], axis=1),
        "webs": np.concatenate([np.stack([rim[:-1], rim[1:]], axis=1) for rim in (left, right)]),
    }
    return _part("hollow", points, cells[keep], sides, material, width, **options)


def _part(name: str, points: np.ndarray, cells: np.ndarray, sides: dict, material: Material, width: float | None, **options) -> Part:
    if width is None:
        return Part(name, points, cells, "quadrilateral", sides, material, **options)
    n = len(points)
    solid = np.concatenate([np.pad(points, ((0, 0), (0, 1)), constant_values=z) for z in (0.0, width)])
    walls = {key: np.concatenate([f, f[:, ::-1] + n], axis=1) for key, f in sides.items()}
    return Part(name, solid, np.concatenate([cells, cells + n], axis=1), "hexahedron", walls, material, **options)


def bent(x: np.ndarray, share: float, seed: int) -> np.ndarray:
    """Positions moved by a few long waves, of strains up to about `share`."""
    rng = np.random.default_rng(seed)
    extent = np.ptp(x, axis=0).max()
    move = np.zeros_like(x)
    for _ in range(4):
        wave = rng.normal(size=x.shape[1])
        wave *= 3 / extent / np.linalg.norm(wave)
        move += rng.normal(size=x.shape[1]) * np.sin(x @ wave + rng.uniform(0, 6))[:, None] * share * extent / 6
    return x + move
