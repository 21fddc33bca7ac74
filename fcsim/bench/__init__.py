"""Measuring solvers on folders of problems: processes with limits, a table of results, what is drawn of it."""
