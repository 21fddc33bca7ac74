"""Random convex polyhedra as rigid bodies, and their signed distance by the Minkowski difference: independent of detection."""

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.mesh.part import RigidBody


def rock(rng: np.random.Generator, corners: int, aspect: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and outward triangles (nt, 3) of a convex polyhedron in a random position, its extents 1 to 1/aspect."""
    direction = rng.normal(size=(corners, 3))
    points = direction / np.linalg.norm(direction, axis=1)[:, None] * rng.uniform(0.7, 1, size=(corners, 1))
    points = points * [1, rng.uniform(1 / aspect, 1), 1 / aspect]
    hull = ConvexHull(points)
    triangles = hull.simplices.copy()
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inwards = np.einsum("td,td->t", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles[inwards] = triangles[inwards][:, ::-1]
    points = points - points.mean(axis=0)  # the origin is inside
    used, numbers = np.unique(triangles, return_inverse=True)
    return points[used] @ Rotation.random(random_state=int(rng.integers(2**31))).as_matrix().T, numbers.reshape(triangles.shape)


def body(name: str, points: np.ndarray, triangles: np.ndarray) -> RigidBody:
    return RigidBody(
        name, 1.0, np.eye(len(points[0])) if points.shape[1] == 3 else np.eye(1), points.mean(axis=0), points, {"all": triangles}
    )


def pair_of_rocks(rng: np.random.Generator, distance: float, aspect: float = 10.0) -> tuple[Model, list[tuple[np.ndarray, np.ndarray]]]:
    """Two rocks whose signed distance along a random way is `distance`: max over the faces n . x <= c of the Minkowski difference."""
    (p, s), (q, t) = (rock(rng, int(rng.integers(4, 40)), rng.uniform(1, aspect)) for _ in range(2))
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    faces = ConvexHull((p[:, None] - q[None]).reshape(-1, 3)).equations
    near, far = 0.0, 4.0
    for _ in range(80):
        middle = 0.5 * (near + far)
        if (faces[:, :3] @ (middle * way) + faces[:, 3]).max() < distance:
            near = middle
        else:
            far = middle
    q = q + near * way
    return build_model([body("one", p, s), body("other", q, t)]), [(p, s), (q, t)]
