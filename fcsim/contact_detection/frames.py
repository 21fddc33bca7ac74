"""Local contact frames from normals."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.surfaces._facet_kernels import frames_of_normals


def frames(normals: FloatArray) -> FloatArray:
    """Orthonormal right-handed frames (nc, d, d), rows N, T1[, T2], for unit normals (nc, d).

    3D: T1 is the x axis made orthogonal to N, and T2 = N x T1: on a horizontal joint T1 = x, T2 = y. Where N is within about 26
    degrees of the x axis (|N_x| > 0.9: head joints) the y axis takes its place. The frame is continuous in N elsewhere.
    2D: T = (-N_y, N_x), N turned by +90 degrees.
    """
    if normals.shape[1] == 2:
        return np.stack([normals, np.stack([-normals[:, 1], normals[:, 0]], axis=1)], axis=1)
    in_space: FloatArray = frames_of_normals(normals)
    return in_space
