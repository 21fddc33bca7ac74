"""What a run is to write as FCLIB files and FCLIB has no place for, refused before its first step."""

from __future__ import annotations

from collections.abc import Sequence

from fcsim.contact_law.law import Law
from fcsim.contact_law.rolling import Rolling, Spinning, contains, resists_both
from fcsim.errors import InputError

_MEND = "write none (fcsim run --export-every 0)"


def refuse_fclib_files(law: Law, every: int, forms: Sequence[str]) -> None:
    """InputError where steps under `law` cannot be written every so many steps (0: never) in these forms, see `two_moments`."""
    if not every:
        return
    if "local" in forms and (contains(law, Rolling) or contains(law, Spinning)):
        raise InputError(
            f"FCLIB form 'local': expected 'global' with rolling or spinning resistance, for which FCLIB has no local form, or {_MEND}"
        )
    if resists_both(law):
        raise InputError(
            "FCLIB files: expected contacts with rolling or with spinning resistance, got a law that has both for one contact: FCLIB's "
            f"rolling problems have two moments a contact; {_MEND}"
        )
