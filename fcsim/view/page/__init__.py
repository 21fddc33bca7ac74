"""The page of a run: one HTML file with its bodies in space, its curves and its numbers, which needs no network (`write_page`)."""

from fcsim.view.page.write import write_page

__all__ = ["write_page"]
