"""Before any test imports NumPy: fcsim limits the threads of BLAS, which fight with those of other processes. Nothing has a deadline."""

import hypothesis

import fcsim  # noqa: F401

hypothesis.settings.register_profile("no clock", deadline=None)  # what is compiled first would be late
hypothesis.settings.load_profile("no clock")
