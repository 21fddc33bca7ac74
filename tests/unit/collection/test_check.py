"""Verification: whatever is wrong with a file is found, named, and stops nothing."""

import csv
import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

from fcsim.collection import Built, check_collection, read_manifest, write_manifest
from fcsim.command_line.main import main
from fcsim.errors import InputError

Damage = Callable[[Path], None]


def flip_a_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x10
    path.write_bytes(content)


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def not_hdf5(path: Path) -> None:
    path.write_text("To whom it may concern\n")


def scale(dataset: str, factor: float) -> Damage:
    def damage(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            file[dataset][:] = factor * file[dataset][:]

    return damage


def one_faster(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file["solution/u"][5] += 1e-3


def without_solution(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["solution"]


def restate(folder: Path, path: Path) -> None:
    """Let the manifest state the damaged file's sum, as somebody would who makes the manifest by hand."""
    place = path.relative_to(folder).as_posix()
    total = hashlib.sha256(path.read_bytes()).hexdigest()
    write_manifest(folder, [replace(e, sha256=total) if e.place == place else e for e in read_manifest(folder)])


def step_3(folder: Path, form: str) -> Path:
    return next((folder / form).glob("*-00003.hdf5"))


def failures(folder: Path) -> dict[str, str]:
    return {row.place: "; ".join(row.failures) for row in check_collection(folder) if row.failures}


def test_a_whole_collection(built: Built) -> None:
    rows = check_collection(built.directory)
    assert [row.failures for row in rows] == [()] * 6
    stated = {entry.place: entry for entry in built.entries}
    for row in rows:
        entry = stated[row.place]
        assert (row.form, row.nc, row.m, row.stated) == (entry.form, entry.nc, entry.m, entry.error)
        assert row.n == (entry.n if entry.form == "global" else None)
        assert row.error == pytest.approx(entry.error, rel=0.2, abs=1e-10)
        assert row.cone <= 1e-8 and row.equations <= 1e-10


@pytest.mark.parametrize("form", ["global", "local"])
@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (flip_a_byte, "SHA-256"),
        (truncate, "truncated or damaged"),
        (not_hdf5, "expected an HDF5 file"),
        (scale("solution/r", 1.01), "SHA-256"),
        (Path.unlink, "missing"),
    ],
)
def test_a_damaged_file_is_named(copy: Path, form: str, damage: Damage, message: str) -> None:
    path = step_3(copy, form)
    damage(path)
    found = failures(copy)
    assert list(found) == [path.relative_to(copy).as_posix()]
    assert message in found[path.relative_to(copy).as_posix()]


@pytest.mark.parametrize(
    ("form", "damage", "message"),
    [
        ("global", scale("solution/r", 1.01), "error of the stored solution"),
        ("local", scale("solution/r", 1.01), "error of the stored solution"),
        ("local", scale("fclib_local/vectors/mu", 1e-3), "error of the stored solution"),
        ("global", scale("solution/v", 1.01), "do not follow from r"),
        ("local", one_faster, "do not follow from r"),
        ("global", one_faster, "do not follow from r"),
        ("global", without_solution, "no /solution"),
    ],
)
def test_a_damage_that_the_sum_hides(copy: Path, form: str, damage: Damage, message: str) -> None:
    path = step_3(copy, form)
    damage(path)
    restate(copy, path)
    found = failures(copy)
    assert list(found) == [path.relative_to(copy).as_posix()]
    assert message in found[path.relative_to(copy).as_posix()]


def test_what_the_manifest_states(copy: Path) -> None:
    entries = read_manifest(copy)
    lies = {"nc": 26, "n": 85, "m": 78, "iterations": 77, "error": 1e-20}
    changed = [
        replace(e, **{name: value}) for e, (name, value) in zip([e for e in entries if e.form == "global"] * 2, lies.items(), strict=False)
    ]
    for lie, (name, value) in zip(changed, lies.items(), strict=True):
        write_manifest(copy, [lie if e.place == lie.place else e for e in entries])
        found = failures(copy)
        if name == "error":  # up to the round-off that differs from machine to machine
            assert not found
        else:
            assert list(found) == [lie.place] and f"states {value}" in found[lie.place]


def test_files_that_the_manifest_does_not_list(copy: Path) -> None:
    step_3(copy, "local").rename(copy / "local" / "another.hdf5")
    found = failures(copy)
    assert found.pop("local/another.hdf5") == "not in the manifest"
    assert len(found) == 1 and "missing" in found.popitem()[1]


def test_a_folder_without_manifest(copy: Path) -> None:
    (copy / "manifest.csv").unlink()
    scale("solution/r", 2.0)(step_3(copy, "global"))
    truncate(step_3(copy, "local"))
    rows = {row.place: row for row in check_collection(copy)}
    assert len(rows) == 6
    failed = [place for place, row in rows.items() if row.failures]
    assert failed == [f"local/{step_3(copy, 'local').name}"]
    doubled = rows[f"global/{step_3(copy, 'global').name}"]
    assert doubled.note == "not a solution" and doubled.error > 0.01 and doubled.stated is None


def test_command(copy: Path, built: Built, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["collection", "check", str(built.directory)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split() == ["file", "nc", "n", "m", "error", "stated", "cone", "equations", "verdict"]
    assert len(printed) == 8 and printed[-1] == "6 files, 0 failed"
    truncate(step_3(copy, "local"))
    assert main(["collection", "check", str(copy)]) == 1
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == "6 files, 1 failed"
    assert printed[-2].startswith(f"FAILED local/{step_3(copy, 'local').name}: changed: SHA-256")
    assert "truncated" in printed[-2]
    assert main(["collection", "check", str(tmp_path / "nothing")]) == 2
    (copy / "manifest.csv").write_text((copy / "manifest.csv").read_text().replace(",3,", ",three,"))
    assert main(["collection", "check", str(copy)]) == 2
    assert "line" in capsys.readouterr().err


def test_manifest_is_a_plain_table(built: Built) -> None:
    with (built.directory / "manifest.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:16] == [
        "name", "form", "step", "time", "nc", "n", "m", "density", "symmetric", "rank", "condition", "solver", "iterations", "error",
        "sha256", "status",
    ]  # fmt: skip
    assert {row["symmetric"] for row in rows} == {"true"}


def test_a_name_that_no_file_can_have(copy: Path) -> None:
    text = (copy / "manifest.csv").read_text().splitlines()
    row = next(csv.reader([text[1]]))
    (copy / "manifest.csv").write_text("\n".join([text[0], text[1].replace(row[0], "9" * 400, 1), *text[2:]]) + "\n")
    with pytest.raises(InputError, match=r"manifest\.csv, line 2, name: expected the name of a file, got '999"):
        check_collection(copy)
