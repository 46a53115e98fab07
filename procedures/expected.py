"""What a bench's sensors should read, by an earlier calibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from scipy import special

from fitter.arrays import FloatArray

Columns = Mapping[str, FloatArray]
"""(n,) by quantity: settings, or what was read where that is known better; NaN where it was not recorded."""


@dataclass(frozen=True, eq=False)
class Expected:
    """What a calibration says of one output.

    Attributes:
        output: (n,) what it expects.
        own: (n,) standard deviation of what is new at every observation.
        shared: (n,) of what neighbouring observations have in common: the calibration's error, the whole plot's.
        df: degrees of freedom of `shared`.
        free: how many ways the shared error has to vary over a run.

    """

    output: FloatArray
    own: FloatArray
    shared: FloatArray
    df: float
    free: int

    def reach(self, chance: float) -> float:
        """Standard deviations that the shared error passes anywhere with this chance (Scheffe)."""
        return math.sqrt(self.free * float(special.fdtri(self.free, self.df, 1.0 - chance)))


Expecting = Callable[[Columns, Mapping[str, float]], Mapping[str, Expected]]
"""By output, from quantities and how the procedure turns the package, degrees by "x_deg" and so on; {} where the
quantities are those of another kind of run.
"""


@dataclass(frozen=True, eq=False)
class Previous:
    """A previous calibration.

    Attributes:
        name: of the file it came from.
        expecting: what it expects, as its kind has it.

    """

    name: str
    expecting: Expecting

    def expected(self, columns: Columns, mounting: Mapping[str, float]) -> Mapping[str, Expected]:
        """By output; {} for a run of another kind. `mounting` is the procedure's, how the package is turned."""
        return self.expecting(columns, mounting)
