"""The laws of a scheme one by one, out of tables and from beside rolling resistance."""

from __future__ import annotations

from collections.abc import Iterator


def single_laws(law: object) -> Iterator[object]:
    """The law itself, or those of a table, and the laws beside which they stand."""
    yield law
    for other in (*getattr(law, "laws", ()), getattr(law, "law", None)):
        if other is not None:
            yield from single_laws(other)
