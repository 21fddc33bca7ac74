"""Values of --over and --table, and their combinations."""

import itertools
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fcsim.campaign.combinations import combinations, read_over, read_table_of_values
from fcsim.errors import InputError


@pytest.mark.parametrize(
    ("text", "name", "values"),
    [
        ("mu=0.3,0.5", "mu", ("0.3", "0.5")),
        (" mu = 0.3 , 0.5 ", "mu", ("0.3", "0.5")),
        ("mu=0.3", "mu", ("0.3",)),
        ("divisions=8,4,4;16,8,8", "divisions", ("8,4,4", "16,8,8")),
        ("divisions=8,4,4;", "divisions", ("8,4,4",)),
        ("E=1e9..4e9/4", "E", ("1000000000", "2000000000", "3000000000", "4000000000")),
        ("mu=0.1..0.5/5", "mu", ("0.1", "0.2", "0.3", "0.4", "0.5")),
        ("mu=.5..-.5/3", "mu", ("0.5", "0", "-0.5")),
        ("E=1e6..1e9/4log", "E", ("1000000", "10000000", "100000000", "1000000000")),
        ("E=1e-200..1e-198/3log", "E", ("1e-200", "1e-199", "1e-198")),
        ("solver=NSN-AC,NSGS-AC", "solver", ("NSN-AC", "NSGS-AC")),
        ("path=../a.msh,../b.msh", "path", ("../a.msh", "../b.msh")),
        ("name=a b,c=d", "name", ("a b", "c=d")),
    ],
)
def test_values(text: str, name: str, values: tuple[str, ...]) -> None:
    assert read_over(text) == (name, values)


@pytest.mark.parametrize(
    "text",
    [
        "mu",
        "=1,2",
        "mu=",
        "mu=1,,2",
        "mu=1..2/1",
        "mu=1..1/3",
        "mu=a..b/3",
        "mu=-1..1/3log",
        "mu=0..inf/3",
        "mu=1..2/1000000",
        "mu=-1e308..1e308/3",
        "mu=1e-300..1e300/5log",
        "mu=1e300..1e-300/5log",
    ],
)
def test_what_is_no_list_of_values_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--over"):
        read_over(text)


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4), st.integers(0, 3))
def test_every_combination_comes_once(counts: list[int], rows: int) -> None:
    over = [(f"p{k}", [str(v) for v in range(count)]) for k, count in enumerate(counts)]
    table = [{"q": str(row)} for row in range(rows)]
    found = combinations(over, table)
    expected = itertools.product(range(max(rows, 1)), *(range(count) for count in counts))
    assert [tuple(int(v) for v in values.values()) for values in found] == [place if rows else place[1:] for place in expected]


def test_names_that_come_twice_and_too_many_combinations_are_refused() -> None:
    with pytest.raises(InputError, match="mu more than once"):
        combinations([("mu", ["1"]), ("mu", ["2"])])
    with pytest.raises(InputError, match="mu more than once"):
        combinations([("mu", ["1"])], [{"mu": "2"}])
    with pytest.raises(InputError, match="got 1000000000"):
        combinations([(name, list(map(str, range(1000)))) for name in "abc"])
    with pytest.raises(InputError, match="none"):
        combinations([])


def test_a_table_of_values(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text('\ufeff# two walls\nmu, divisions\n0.3,"8,4,4"\n\n 0.5 ,"4,2,2"\n', encoding="utf-8")
    assert read_table_of_values(path) == [{"mu": "0.3", "divisions": "8,4,4"}, {"mu": "0.5", "divisions": "4,2,2"}]


@pytest.mark.parametrize(
    "content",
    [
        "",
        "mu\n",
        "mu,mu\n1,2\n",
        "mu,E\n1\n",
        "mu,\n1,2\n",
        "\0",
        'mu,a\n0.3,"x\n0.4,y\n',
        "mu;E\n1;2\n",
        "mu;E\n1,5;2,5\n",
        "mu\tE\n1\t2\n",
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"runs\.csv"):
        read_table_of_values(path)
    with pytest.raises(InputError, match="found none"):
        read_table_of_values(tmp_path / "absent.csv")


def test_what_is_wrong_with_a_table_is_said(tmp_path: Path) -> None:
    """A quotation mark that is not closed took the rows behind it for one cell; a spreadsheet's semicolons were "1 values"."""
    path = tmp_path / "runs.csv"
    for content, said in (
        ('mu,a\n0.3,"x\n0.4,y\n', "quotation marks are closed"),
        ("mu;E\n1,5;2,5\n", "expected commas between the cells"),
    ):
        path.write_text(content, encoding="utf-8")
        with pytest.raises(InputError, match=said):
            read_table_of_values(path)


def test_an_empty_cell_is_named_by_its_row_and_column(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("mu,E\n0.3,1e9\n0.5,\n")
    with pytest.raises(InputError, match="row 2: expected a value of 'E', got an empty cell"):
        read_table_of_values(path)


@pytest.mark.parametrize("text", ["mu=0.3..0.5", "E=1e9..4e9", "x=-1.5..2", "n=1..5"])
def test_a_range_without_a_count_is_told_what_it_lacks(text: str) -> None:
    with pytest.raises(InputError, match=r"expected how many values the range has, FIRST\.\.LAST/COUNT"):
        read_over(text)
