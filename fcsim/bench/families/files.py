"""Problems of the families as FCLIB files: FOLDER/FAMILY/FAMILY-SIZE-SEED.hdf5, and FOLDER/problems.json, which says what made them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path

from fcsim.bench.families import FAMILIES, problems, refuse_unknown
from fcsim.errors import InputError
from fcsim.export_fclib import write_fclib
from fcsim.files import replacing
from fcsim.version import __version__

NOTE = "problems.json"


def digest() -> str:
    """SHA-256 of the sources of the families: two versions with the same one make the same problems."""
    sources = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        sources.update(path.name.encode() + b"\0" + path.read_bytes())
    return sources.hexdigest()


def write_problems(
    folder: Path,
    families: Sequence[str],
    sizes: Sequence[int],
    seeds: Sequence[int],
    progress: Callable[[int, int, str], None] = lambda done, total, name: None,
) -> dict[Path, str]:
    """Write the problems that `folder` lacks, and return the family of each file asked for, in order; progress(done, total, name).

    Raises InputError for an unknown family, size or seed (`fcsim.bench.families.problems`), before anything is written, and for a folder
    whose problems other sources made.
    """
    refuse_unknown(families, sizes, seeds)
    own, note = digest(), folder / NOTE
    if note.is_file():
        try:
            known = json.loads(note.read_text(encoding="utf-8"))["families"]
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{note}: expected the note of fcsim leaderboard on its problems, JSON ({error})") from None
        if known != own:
            raise InputError(f"{folder}: its problems were made by another version of their families; choose another FOLDER")
    else:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(note) as temporary:
            temporary.write_text(json.dumps({"families": own, "version": __version__}, indent=1) + "\n", encoding="utf-8")
    made: dict[Path, str] = {}
    asked = list(product(families, sizes, seeds))
    for number, (family, size, seed) in enumerate(asked):
        path = folder / family / f"{family}-{size}-{seed}.hdf5"
        progress(number, len(asked), path.stem)
        if not path.is_file():
            path.parent.mkdir(exist_ok=True)
            write_fclib(path, problems(family, size, seed), title=path.stem, description=FAMILIES[family].about)
        made[path] = family
    progress(len(asked), len(asked), "")
    return made
