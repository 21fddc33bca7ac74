"""The part of a bench's page that answers: profiles, a table problem by problem, one problem's convergence, two benches side by side."""

from fcsim.bench.reporting.explorer.section import explorer_section

__all__ = ["explorer_section"]
