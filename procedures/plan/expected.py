"""Expected readings of a bench's sensors by an earlier calibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from scipy import special

from rig.fitter.arrays import FloatArray

Columns = Mapping[str, FloatArray]
"""(n,) values by quantity: measured if available, otherwise setpoints; NaN if not recorded."""


@dataclass(frozen=True, eq=False)
class Expected:
    """Prediction of one output by a calibration.

    Attributes:
        output: (n,) expected values.
        own: (n,) standard deviation of errors that are new at every observation.
        shared: (n,) standard deviation of errors common to neighbouring observations: the calibration's error, the
            whole plot's.
        df: degrees of freedom of `shared`.
        free: number of independent directions of the shared error over a run.
    """

    output: FloatArray
    own: FloatArray
    shared: FloatArray
    df: float
    free: int

    def reach(self, chance: float) -> float:
        """Limit of the shared error, in its standard deviations, for this probability of exceeding it anywhere
        (Scheffe).
        """
        return math.sqrt(self.free * float(special.fdtri(self.free, self.df, 1.0 - chance)))


Expecting = Callable[[Columns, Mapping[str, float]], Mapping[str, Expected]]
"""Predictions by output, from quantities and the package's orientation, degrees by "x_deg" and so on; {} for quantities
of another kind of run.
"""


@dataclass(frozen=True, eq=False)
class Previous:
    """A previous calibration.

    Attributes:
        name: of its file.
        expecting: its prediction, a function of its kind.
    """

    name: str
    expecting: Expecting

    def expected(self, columns: Columns, mounting: Mapping[str, float]) -> Mapping[str, Expected]:
        """Predictions by output; {} for a run of another kind. `mounting` is the orientation of the package in the
        procedure.
        """
        return self.expecting(columns, mounting)
