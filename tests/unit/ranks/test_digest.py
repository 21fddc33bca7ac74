"""What ranks compare their numbers by."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.arrays import FloatArray
from fcsim.ranks import digest_of
from fcsim.ranks._digest_kernels import digest

WORD = 2**64
PRIMES = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)  # of XXH64, from its specification


def lanes(numbers: FloatArray) -> list[int]:
    out = np.empty(4, dtype=np.uint64)
    digest(numbers.view(np.uint64), out)
    return [int(lane) for lane in out]


def in_integers(numbers: FloatArray) -> list[int]:
    """The same with Python's integers: round(lane, word) = rotl(lane + word P2, 31) P1."""
    words = [int.from_bytes(x.tobytes(), "little") for x in numbers]
    four, whole = [*PRIMES, len(words)], len(words) // 4 * 4
    for i, word in enumerate(words):
        k = i % 4 if i < whole else 0
        mixed = (four[k] + word * PRIMES[1]) % WORD
        four[k] = (mixed << 31 | mixed >> 33) % WORD * PRIMES[0] % WORD
    return four


@pytest.mark.parametrize("count", [0, 1, 4, 11, 400])
def test_it_is_what_integers_give(count: int) -> None:
    numbers = np.random.default_rng(count).standard_normal(count)
    assert lanes(numbers) == in_integers(numbers)


def test_last_bits_signs_of_zero_and_places_count() -> None:
    numbers = np.random.default_rng(0).standard_normal(37)
    numbers[5] = 0.0
    seen = {tuple(lanes(numbers))}
    for k in range(len(numbers)):
        other = numbers.copy()
        other[k] = -0.0 if k == 5 else np.nextafter(other[k], 9)
        seen.add(tuple(lanes(other)))
    for k in range(len(numbers) - 1):
        other = numbers.copy()
        other[[k, k + 1]] = other[[k + 1, k]]
        seen.add(tuple(lanes(other)))
    assert len(seen) == 1 + 37 + 36


def test_types_shapes_and_what_is_left_of_a_word_count() -> None:
    numbers = np.arange(23, dtype=np.int32)
    others = [numbers.astype(np.int64), numbers[:-1], numbers[1:], numbers[:-1].reshape(2, 11), numbers[:-1].reshape(11, 2)]
    last = numbers.copy()
    last[-1] += 1
    arrays = [numbers, *others, last, numbers.astype(np.float32), numbers > 3, numbers > 22]
    assert len({digest_of(array) for array in arrays}) == len(arrays)
    assert digest_of(numbers[1:]) == digest_of(numbers[1:].copy()) and digest_of(numbers[::2]) == digest_of(numbers[::2].copy())
    assert digest_of(numbers, last) != digest_of(last, numbers)
