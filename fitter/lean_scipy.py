"""The first import of SciPy, without what it loads of NumPy for nothing.

SciPy copies every name of NumPy into a namespace of its own, and modules are imported for it that nothing uses: a third
of the time of the import and 9 MB. Empty modules stand for them meanwhile. All can be imported afterwards.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

UNUSED = ("char", "ctypeslib", "f2py", "ma", "polynomial", "rec", "strings", "testing")

_instead = {name: ModuleType(f"numpy.{name}") for name in UNUSED if name not in vars(np)}
vars(np).update(_instead)
try:
    import scipy.special  # noqa: F401
finally:
    for _name, _module in _instead.items():
        if vars(np).get(_name) is _module:
            delattr(np, _name)
