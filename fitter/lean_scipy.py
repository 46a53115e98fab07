"""The first import of SciPy, without what it loads for other array libraries, tests, Fortran and documentation alone.

SciPy copies every name of NumPy into a namespace of its own, and modules are imported for it that nothing uses: empty
ones stand for them meanwhile, and they can be imported afterwards. It also writes a table of array libraries into the
documentation of each special function. Without both, the import takes half of the time and 9 MB less.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

UNUSED = ("char", "ctypeslib", "f2py", "ma", "polynomial", "rec", "strings", "testing")


@contextmanager
def _meanwhile(module: ModuleType, **others: Any) -> Iterator[None]:
    """Other attributes of a module, until the end; then as before, unless they were replaced."""
    before = vars(module).copy()
    vars(module).update(others)
    try:
        yield
    finally:
        for name, other in others.items():
            if vars(module).get(name) is other:
                if name in before:
                    setattr(module, name, before[name])
                else:
                    delattr(module, name)


with _meanwhile(np, **{name: ModuleType(f"numpy.{name}") for name in UNUSED if name not in vars(np)}):
    from scipy._lib import _array_api

    with _meanwhile(_array_api, xp_capabilities=lambda **_: lambda function: function):
        import scipy.special  # noqa: F401
