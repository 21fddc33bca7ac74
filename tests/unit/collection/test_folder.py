"""Folders of collections: what may be replaced, what is checked of a manifest, and paths that lead elsewhere."""

import csv
import errno
import shutil
from pathlib import Path

import pytest

from fcsim.cluster import Cluster
from fcsim.collection import check_collection, read_manifest
from fcsim.collection.folder import refuse_folder, whole_folder
from fcsim.collection.jobs import Build, build_by_job
from fcsim.collection.manifest import MANIFEST
from fcsim.errors import InputError


def change(collection: Path, column: str, text: str, row: int = 1) -> None:
    """Change a cell of the manifest."""
    with (collection / MANIFEST).open(newline="") as file:
        rows = list(csv.reader(file))
    rows[row][rows[0].index(column)] = text
    with (collection / MANIFEST).open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def content(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def make(out: Path, *, overwrite: bool = True) -> None:
    with whole_folder(out, overwrite) as folder:
        (folder / "README.md").write_text("new")


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the temporary one beside it, of which nobody knows; before anything is computed where that can be asked."""

    def read_only(prefix: str, suffix: str, dir: Path) -> str:
        raise OSError(errno.EROFS, "Read-only file system", f"{dir}/{prefix}x{suffix}")

    with monkeypatch.context() as patched:
        patched.setattr("tempfile.mkdtemp", read_only)
        with pytest.raises(OSError, match="Read-only") as raised:
            make(tmp_path / "out")
        assert raised.value.filename == str(tmp_path / "out")
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(InputError, match=f"out: expected a folder that can be written to, {tmp_path} cannot"):
        make(tmp_path / "not" / "there" / "out")


def test_a_copy_that_finds_no_room_is_named_by_its_collection(tmp_path: Path) -> None:
    """A copy's error names both files, and the temporary one was told."""
    with pytest.raises(OSError, match="No space") as raised, whole_folder(tmp_path / "out") as folder:
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "from.hdf5"), None, str(folder / "global" / "to.hdf5"))
    assert (raised.value.filename, raised.value.filename2) == (str(tmp_path / "out"), None)


def test_a_collection_is_replaced(copy: Path) -> None:
    make(copy)
    assert content(copy) == {"README.md": b"new"}
    assert [path.name for path in copy.parent.iterdir()] == ["copy"]


@pytest.mark.parametrize("mine", ["README.md", "local/data.hdf5", "global/notes.txt", "picture.png", "manifest.csv"])
def test_a_folder_that_only_looks_like_one_is_kept(tmp_path: Path, mine: str) -> None:
    """Names that collections have, and no manifest that says so."""
    folder = tmp_path / "mine"
    (folder / mine).parent.mkdir(parents=True)
    (folder / mine).write_text("mine")
    with pytest.raises(InputError):
        make(folder)
    assert content(folder) == {mine: b"mine"}


@pytest.mark.parametrize("mine", ["local/mine.hdf5", "notes.txt", "global/deep/x.png"])
def test_files_of_others_in_a_collection_are_kept(copy: Path, mine: str) -> None:
    (copy / mine).parent.mkdir(exist_ok=True)
    (copy / mine).write_text("mine")
    before = content(copy)
    with pytest.raises(InputError, match=f"found {mine} in it"):
        make(copy)
    assert content(copy) == before


def test_a_linked_folder_is_not_emptied(copy: Path, tmp_path: Path) -> None:
    shutil.move(copy / "local", tmp_path / "elsewhere")
    (copy / "local").symlink_to(tmp_path / "elsewhere")
    held = content(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="found local in it"):
        make(copy)
    assert content(tmp_path / "elsewhere") == held


def test_two_writers_and_one_that_was_killed(tmp_path: Path) -> None:
    """The second is refused before its work, to replace something too; what a killed one left is removed, what one holds is not."""
    left = tmp_path / ".out.abc.fcsim-collection.partial"
    left.mkdir()
    (left / "README.md").write_text("half")
    worked = False
    with whole_folder(tmp_path / "out") as first:
        assert not left.exists()
        for overwrite in (False, True):
            with pytest.raises(InputError, match=r"another fcsim collection is making it"), whole_folder(tmp_path / "out", overwrite):
                worked = True
        with whole_folder(tmp_path / "other"):
            assert first.exists()
    assert not worked and (tmp_path / "out").is_dir() and not list(tmp_path.glob(".out*"))


def test_a_job_is_not_asked_for_what_is_refused(copy: Path) -> None:
    build = Build(source="nowhere", out=str(copy))
    with pytest.raises(InputError, match=r"holds a collection; replace it with --overwrite"):
        build_by_job(build, Cluster("jobs", seconds=1.0, at_once=1))


@pytest.mark.parametrize("name", ["../../secret.hdf5", "/etc/passwd", "..", "a/b.hdf5", ""])
def test_names_that_lead_elsewhere_are_refused(copy: Path, name: str) -> None:
    change(copy, "name", name)
    with pytest.raises(InputError, match=r"manifest\.csv, line 2, name: expected the name of a file"):
        read_manifest(copy)


def test_a_form_is_global_or_local(copy: Path) -> None:
    change(copy, "form", "..")
    with pytest.raises(InputError, match=r"line 2, form: expected global or local"):
        check_collection(copy)


def test_a_link_out_of_the_collection_is_not_opened(copy: Path, tmp_path: Path) -> None:
    path = next((copy / "local").iterdir())
    shutil.move(path, tmp_path / "outside.hdf5")
    path.symlink_to(tmp_path / "outside.hdf5")
    [row] = [row for row in check_collection(copy) if row.failures]
    assert row.failures == ("a link that leads out of the collection",)


def test_a_row_for_each_file(copy: Path) -> None:
    """A manifest that lists a file twice, with another digest: what two files of one name leave."""
    lines = (copy / MANIFEST).read_text().splitlines(keepends=True)
    digest = read_manifest(copy)[0].sha256
    (copy / MANIFEST).write_text("".join(lines) + lines[1].replace(digest, "0" * 64))
    [row] = [row for row in check_collection(copy) if row.failures]
    assert row.failures[0] == "listed 2 times in the manifest, for one file" and "changed: SHA-256" in row.failures[1]


def test_a_file_is_no_place_for_a_collection(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="found a file"):
        refuse_folder(tmp_path / "file", True)


def test_manifests_of_earlier_versions_are_read(copy: Path) -> None:
    """Without the parameters, which came later."""
    with (copy / MANIFEST).open(newline="") as file:
        rows = [row[:-1] for row in csv.reader(file)]
    with (copy / MANIFEST).open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    assert {entry.parameters for entry in read_manifest(copy)} == {""}
    assert not any(row.failures for row in check_collection(copy))
