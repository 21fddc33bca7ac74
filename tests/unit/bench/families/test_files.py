"""Problems of the families as files: the same ones wherever they are made, and never those of two versions in one folder."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.bench.families import problems
from fcsim.bench.families.files import NOTE, write_problems
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib


def test_files_hold_the_problems_of_their_names(tmp_path: Path) -> None:
    made = write_problems(tmp_path, ["disks", "rods"], [4], [0, 1])
    assert [path.stem for path in made] == ["disks-4-0", "disks-4-1", "rods-4-0", "rods-4-1"]
    assert list(made.values()) == ["disks", "disks", "rods", "rods"]
    for path, family in made.items():
        read, own = read_fclib(path).problem, problems(family, 4, int(path.stem[-1]))
        assert read.dimension == own.dimension
        for name in ("M", "H"):
            assert abs(sp.csc_array(getattr(read, name)) - sp.csc_array(getattr(own, name))).max() == 0
        for name in ("f", "w", "mu"):
            assert np.array_equal(getattr(read, name), getattr(own, name))


def test_only_what_lacks_is_written(tmp_path: Path) -> None:
    first = next(iter(write_problems(tmp_path, ["rods"], [3], [0])))
    before = first.stat()
    told: list[tuple[int, int, str]] = []
    made = write_problems(tmp_path, ["rods"], [3], [0, 1], lambda *now: told.append(now))
    assert [path.stem for path in made] == ["rods-3-0", "rods-3-1"]
    assert first.stat().st_mtime_ns == before.st_mtime_ns and first.stat().st_ino == before.st_ino
    assert told == [(0, 2, "rods-3-0"), (1, 2, "rods-3-1"), (2, 2, "")]


def test_problems_of_another_version_are_not_mixed(tmp_path: Path) -> None:
    write_problems(tmp_path, ["rods"], [3], [0])
    note = tmp_path / NOTE
    about = json.loads(note.read_text(encoding="utf-8"))
    note.write_text(json.dumps(about | {"families": "0" * 64}), encoding="utf-8")
    with pytest.raises(InputError, match="made by another version of their families; choose another FOLDER"):
        write_problems(tmp_path, ["rods"], [3], [1])
    note.write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match=r"problems\.json: expected the note of fcsim leaderboard"):
        write_problems(tmp_path, ["rods"], [3], [1])
    assert not (tmp_path / "rods" / "rods-3-1.hdf5").exists()


@pytest.mark.parametrize(
    ("family", "size", "seed", "said"), [("cubes", 3, 0, "family 'cubes'"), ("rods", 0, 0, "size:"), ("rods", 3, -1, "seed:")]
)
def test_what_is_no_problem_is_named(tmp_path: Path, family: str, size: int, seed: int, said: str) -> None:
    with pytest.raises(InputError, match=said):
        write_problems(tmp_path, [family], [size], [seed])
    assert not list(tmp_path.rglob("*.hdf5"))
