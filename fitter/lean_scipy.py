"""The first import of SciPy, without what it needs of NumPy for tests and Fortran alone.

SciPy copies every name of NumPy into a namespace of its own, and modules are imported for it: `numpy.f2py` and
`numpy.testing`, which cost a fifth of the time of the import and 9 MB. Empty modules stand for them meanwhile. Both can
be imported afterwards.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

UNUSED = ("f2py", "testing")

_instead = {name: ModuleType(f"numpy.{name}") for name in UNUSED if name not in vars(np)}
vars(np).update(_instead)
try:
    import scipy.special  # noqa: F401
finally:
    for _name, _module in _instead.items():
        if vars(np).get(_name) is _module:
            delattr(np, _name)
