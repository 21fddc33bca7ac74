"""Before any test imports NumPy: fcsim limits the threads of BLAS, which fight with those of other processes. Nothing has a deadline."""

import gc
from collections.abc import Generator

import hypothesis
import pytest

import fcsim  # noqa: F401

hypothesis.settings.register_profile("no clock", deadline=None)  # what is compiled first would be late
hypothesis.settings.load_profile("no clock")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected, 12 000 tests and the modules they are in, lives to the end: Python's collector of cycles need not walk through
    it again and again, half a second each time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()
