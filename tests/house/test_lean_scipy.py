"""SciPy is imported without what it loads of NumPy for nothing, and all of it can be imported afterwards."""

import subprocess
import sys

import numpy as np

from rig.fitter.sums_of_squares import project_out

IMPORT = """
import sys
import rig.fitter
from rig.fitter.lean_scipy import UNUSED
assert not {f"numpy.{name}" for name in UNUSED} & set(sys.modules), "imported"
import rig.procedures.attitude.trace, rig.procedures.pressure.trace
assert not {"numpy.f2py", "numpy.testing", "scipy.stats", "scipy.optimize"} & set(sys.modules), "imported"
import numpy, scipy.special
numpy.testing.assert_allclose(1.0, 1.0)
assert all(getattr(numpy, name).__file__ for name in UNUSED)
"""


def test_none_is_imported_and_all_can_be():
    done = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_what_is_left_may_take_the_place_of_the_columns():
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.standard_normal((200, 5)))[0]
    columns = np.asfortranarray(rng.standard_normal((200, 70)))
    expected = project_out(columns, basis)
    assert project_out(columns, basis, overwrite=True) is columns
    assert np.array_equal(columns, expected)
