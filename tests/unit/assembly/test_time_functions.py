"""Ramps, tables and acceleration records: against their integrals in closed form; every kind of bad file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from fcsim.assembly.time_functions import AccelerationRecord, GravityRamp, Ramp, Table, read_acceleration_record, read_table
from fcsim.errors import InputError


def test_ramps() -> None:
    ramp = Ramp(1.0, 3.0, 10.0, 20.0)
    assert [ramp(t) for t in (0, 1, 2, 3, 9)] == [10, 10, 15, 20, 20]
    assert ramp == Ramp(1.0, 3.0, 10.0, 20.0)  # two supports that say the same do not contradict each other
    assert_allclose(GravityRamp((0.0, 0.0, -9.81), 0.0, 2.0)(0.5), [0, 0, -9.81 / 4])
    for bad in ((1.0, 1.0), (2.0, 1.0), (0.0, float("nan"))):
        with pytest.raises(InputError, match="t0 < t1"):
            Ramp(*bad)
        with pytest.raises(InputError, match="t0 < t1"):
            GravityRamp((0.0, -9.81), *bad)


def test_a_table_holds_its_ends_and_a_record_does_not() -> None:
    times, values = [0.0, 1.0, 3.0], [2.0, 4.0, 0.5]
    table, record = Table(times, values), AccelerationRecord(times, values)  # type: ignore[arg-type]
    assert [table(t) for t in (-1, 0, 0.5, 2, 3, 7)] == [2, 2, 3, 2.25, 0.5, 0.5]
    assert [record(t) for t in (-1, 0, 0.5, 2, 3, 7)] == [0, 2, 3, 2.25, 0.5, 0]


def test_integrals_of_a_record_are_exact() -> None:
    rng = np.random.default_rng(1)
    record = AccelerationRecord(np.cumsum(rng.uniform(0.05, 0.3, 12)), rng.standard_normal(12))
    begin, end = record.times[0], record.times[-1]
    for t in (begin - 1, begin, *rng.uniform(begin, end, 8), end, end + 2):
        inside = [p for p in record.times if p < t]
        velocity = quad(record, begin - 1, t, points=inside or None, limit=200, epsabs=1e-13)[0] if t > begin else 0.0
        displacement = quad(record.velocity, begin - 1, t, points=inside or None, limit=200, epsabs=1e-13)[0] if t > begin else 0.0
        assert_allclose(record.velocity(t), velocity, atol=1e-10)
        assert_allclose(record.displacement(t), displacement, atol=1e-10)
    later = record.scaled(3.0).delayed(0.7)
    assert_allclose(later.velocity(end + 0.2), 3 * record.velocity(end - 0.5))
    assert isinstance(later, AccelerationRecord)
    assert record.velocity == record.velocity  # one record for two supports of one dof is no contradiction


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_text("# made by hand\nt [ms], a [g], note [1]\n0, 0, 1\n# in between\n\n500, 0.5, 2\n1000, -1, 3\n")
    record = read_acceleration_record(path)
    assert_allclose(record.times, [0, 0.5, 1.0])
    assert_allclose(record.values, 9.80665 * np.array([0, 0.5, -1]))
    assert_allclose(read_table(path, "note").values, [1, 2, 3])
    path.write_text("\ufefftime [s];a\n".replace(";", ",") + "0,1\n1,2\n", encoding="utf-8")
    assert_allclose(read_table(path, "a", time="time").values, [1, 2])


GOOD = "t [s], a [m/s^2]\n0, 1\n1, 2\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"record\.csv: expected a header 't \[s\], a \[unit\]' and rows of numbers, found none"),
        (GOOD.replace("a [", "b ["), r"expected a column 'a' in the header, found t, b"),
        (GOOD.replace(",", ";"), r"expected a column 'a' in the header, found 't \[s\]; a \[m/s\^2\]' alone; commas separate entries"),
        (GOOD.replace("\n", ", a [g]\n", 1), r"expected each column once in the header, found t, a, a"),
        (GOOD.replace("t [s]", "time [s]"), r"expected a column 't' in the header, found time, a"),
        (GOOD.replace("m/s^2", "m/s"), r"column 'a' as a \[unit\] with a unit among m/s\^2, cm/s\^2, Gal, g, found 'm/s'"),
        (GOOD.replace(" [m/s^2]", ""), r"with a unit among m/s\^2, cm/s\^2, Gal, g, found ''"),
        (GOOD.replace("t [s]", "t [h]"), r"column 't' as t \[unit\] with a unit among s, ms, us, min, found 'h'"),
        (GOOD.replace("1, 2", "1"), r"line 3: expected 2 entries as in the header, found 1"),
        (GOOD.replace("1, 2", "1, 2, 3"), r"line 3: expected 2 entries as in the header, found 3"),
        (GOOD.replace("1, 2", "1, two"), r"line 3: expected a number in column 'a', found 'two'"),
        (GOOD.replace("1, 2", "1, nan"), r"line 3: expected a finite number in column 'a', found 'nan'"),
        (GOOD.replace("1, 2", "0, 2"), r"record\.csv: AccelerationRecord: expected increasing times, got 0 s and then 0 s"),
        (GOOD.replace("1, 2\n", ""), r"expected two times or more and as many values, got 1 and 1"),
    ],
)
def test_bad_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "record.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_acceleration_record(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: expected a CSV file of times and values"):
        read_table(tmp_path / "none.csv", "a")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match=r"binary\.csv: expected a CSV file"):
        read_table(tmp_path / "binary.csv", "a")
    with pytest.raises(InputError, match="quantity: expected one of time, length"):
        read_table(tmp_path / "none.csv", "a", "speed")


@pytest.mark.parametrize(
    ("times", "values"), [([0, 1], [1]), ([0], [1]), ([1, 0], [1, 2]), ([0, np.inf], [1, 2]), ([0, 1], ["a", "b"]), ([[0, 1]], [[1, 2]])]
)
def test_bad_tables(times: Any, values: Any) -> None:
    with pytest.raises(InputError, match="Table"):
        Table(times, values)


@pytest.mark.parametrize("text", ['t [s],a\n0,"1\n1,2"\n2,3\n', 't [s],"a\nb"\n0,1\n1,2\n', "t [s],a\n0," + "1" * 200_000 + "\n1,2\n"])
def test_lines_that_are_no_csv(tmp_path: Path, text: str) -> None:
    """A quoted line end would swallow the next line."""
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(InputError, match=r"table\.csv, line [12]: expected entries separated by commas"):
        read_table(tmp_path / "table.csv", "a")
