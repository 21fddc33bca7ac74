"""Frames, and the contact matrix against its definition entry by entry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fcsim.contact_detection import Contacts, contact_matrix
from fcsim.contact_detection.frames import frames
from fcsim.errors import InputError


def random_contacts(d: int, nc: int, seed: int) -> Contacts:
    generator = np.random.default_rng(seed)
    normals = generator.normal(size=(nc, d))
    nodes = np.array([generator.permutation(20)[:7] for _ in range(nc)]).reshape(nc, 7)
    weights = generator.normal(size=(nc, 7))
    none = generator.uniform(size=(nc, 7)) < 0.2
    nodes[none], weights[none] = -1, 0.0
    weights[generator.uniform(size=(nc, 7)) < 0.1] = 0.0
    return Contacts(
        point=generator.normal(size=(nc, d)),
        frame=frames(normals / np.linalg.norm(normals, axis=1)[:, None]),
        gap=np.zeros(nc),
        mu=np.zeros(nc),
        nodes=nodes,
        weights=weights,
        bodies=np.zeros((nc, 2), dtype=int),
        identity=np.arange(nc),
    )


@given(st.integers(0, 10**6), st.sampled_from([2, 3]))
def test_frames_are_orthonormal_and_right_handed(seed: int, d: int) -> None:
    normals = np.random.default_rng(seed).normal(size=(50, d))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = frames(normals)
    np.testing.assert_array_equal(found[:, 0], normals)
    np.testing.assert_allclose(found @ found.transpose(0, 2, 1), np.broadcast_to(np.eye(d), (50, d, d)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(found), 1.0, atol=1e-14)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1, -1])
def test_tangents_of_axis_normals_are_axes(axis: int, sign: int) -> None:
    found = frames(sign * np.eye(3)[[axis]])[0]
    np.testing.assert_array_equal(np.sort(np.abs(found), axis=1), [[0, 0, 1]] * 3)
    assert found[1, 1 if axis == 0 else 0] == 1  # T1 = y on normals along x, else x


@given(st.integers(0, 10**6))
def test_frames_change_little_with_the_normal(seed: int) -> None:
    generator = np.random.default_rng(seed)
    normal = generator.normal(size=3)
    normal /= np.linalg.norm(normal)
    if abs(abs(normal[0]) - 0.9) < 1e-5:
        return
    other = normal + 1e-6 * generator.uniform(-1, 1, 3)
    pair = frames(np.stack([normal, other / np.linalg.norm(other)]))
    assert np.abs(pair[0] - pair[1]).max() < 1e-5


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("nc", [0, 1, 30])
def test_contact_matrix_is_its_definition(d: int, nc: int) -> None:
    contacts = random_contacts(d, nc, seed=nc)
    expected = np.zeros((20 * d, d * nc))
    for a in range(nc):
        for node, weight in zip(contacts.nodes[a], contacts.weights[a], strict=True):
            if node >= 0:
                expected[d * node : d * node + d, d * a : d * a + d] += weight * contacts.frame[a].T
    H = contact_matrix(contacts, 20)
    assert H.format == "csc"
    assert H.shape == expected.shape
    assert H.nnz == d * d * np.count_nonzero(contacts.weights)
    np.testing.assert_array_equal(H.toarray(), expected)
    assert all((np.diff(H.indices[H.indptr[j] : H.indptr[j + 1]]) > 0).all() for j in range(d * nc))


def test_contact_matrix_refuses_unknown_nodes() -> None:
    with pytest.raises(InputError, match="n_nodes = 5"):
        contact_matrix(random_contacts(3, 4, seed=0), 5)
