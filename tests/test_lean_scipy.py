"""SciPy is imported without NumPy's tests and Fortran, and both can be imported afterwards."""

import subprocess
import sys

import numpy as np

from fitter.sums_of_squares import off

IMPORT = """
import sys
import procedures.attitude.trace, procedures.pressure.trace
assert not {"numpy.f2py", "numpy.testing"} & set(sys.modules), "imported"
import numpy
numpy.testing.assert_allclose(1.0, 1.0)
assert numpy.f2py.__file__
"""


def test_neither_is_imported_and_both_can_be():
    done = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_what_is_left_may_take_the_place_of_the_columns():
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.standard_normal((200, 5)))[0]
    columns = np.asfortranarray(rng.standard_normal((200, 70)))
    expected = off(columns, basis)
    assert off(columns, basis, overwrite=True) is columns
    assert np.array_equal(columns, expected)
