"""Which combinations of parameters are quick of tests marked `each_value` (tests/conftest.py)."""

from itertools import product

import pytest

from tests.conftest import covering, values_of


@pytest.mark.parametrize("sizes", [(3,), (2, 3), (3, 5), (2, 2, 4), (1, 2)])
def test_every_value_is_in_one_of_as_many_combinations_as_the_longest_has_values(sizes: tuple[int, ...]) -> None:
    cases = [dict(zip("abc", values, strict=False)) for values in product(*map(range, sizes))]
    chosen = covering(cases)
    assert len(chosen) == max(sizes)
    for name, size in zip("abc", sizes, strict=False):
        assert {cases[k][name] for k in chosen} == set(range(size))


def test_values_of_short_lists_are_used_alike() -> None:
    cases = [{"a": one, "b": two} for one in range(2) for two in range(6)]
    assert [cases[k]["a"] for k in covering(cases)].count(0) == 3


def test_values_that_go_together_alone_are_there() -> None:
    cases = [{"a": 0, "b": 0}, {"a": 0, "b": 1}, {"a": 1, "b": 0}]
    assert {value for k in covering(cases) for value in cases[k].items()} == {("a", 0), ("a", 1), ("b", 0), ("b", 1)}
    assert covering([]) == set()


@pytest.mark.parametrize("one", [1.5, 2.5])
@pytest.mark.parametrize(("two", "three"), [(0, "a"), (0, "b")])
def test_values_are_those_of_each_parametrize(one: float, two: int, three: str, request: pytest.FixtureRequest) -> None:
    assert values_of(request.node) == {"one": (id(one),), "two,three": (id(two), id(three))}
