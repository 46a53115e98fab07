"""Requirements of control charts on a kind: its calibrations from a table or a file, and one sensor over several."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.history import Charted
from rig.procedures.tables.table import Table


@dataclass(frozen=True, eq=False)
class Calibrations:
    """The sensors of one calibration.

    Attributes:
        sensors: by output column, objects of their kind.
        effects: names of the effects fitted with the model, by output column.
        simulated: whether from a simulated run.
        provenance: its provenance.
        degC: mean sensor temperature; None if it was not recorded, or is irrelevant to the charted parameters.
        corrected: whether `Charting.at` can convert every sensor to another temperature.
    """

    sensors: Mapping[str, Any]
    effects: Mapping[str, tuple[str, ...]]
    simulated: bool
    provenance: Mapping[str, Any]
    degC: float | None = None
    corrected: bool = False


@dataclass(frozen=True)
class Shown:
    """Display of the changes of one charted parameter.

    Attributes:
        label: of the parameter, for people.
        scale: factor for a change.
        unit: of the product.
    """

    label: str
    scale: float
    unit: str


@dataclass(frozen=True, eq=False)
class View:
    """One sensor over m calibrations.

    Attributes:
        charted: q charted parameters, and p parameters for people.
        shown: how each of the q is shown, by name.
        rows: (H, q) derivative of the output by each charted parameter, over the range of use.
        model: the fitted model.
        unit: of the output.
        drawn: unit of plots of the output's error, and its number per `unit`.
        usage: range of use, for the bound of the output's error.
        usage_words: the same for people.
        interval: half-width of the 95 % interval of one reading, at its widest.
        remarks: notes for readers.
    """

    charted: Charted
    shown: Mapping[str, Shown]
    rows: FloatArray
    model: str
    unit: str
    drawn: tuple[str, float]
    usage: tuple[float, float]
    usage_words: str
    interval: float
    remarks: Sequence[str] = ()


class Charting(ABC):
    """A kind's knowledge of calibrations to chart; sensors are those of its `Calibrations`.

    Attributes:
        at_one_temperature: whether the charted parameters are for one temperature of the sensor.
    """

    at_one_temperature = False

    @abstractmethod
    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """Calibrate every sensor of a table.

        Args:
            table: of this kind; or of no known kind if the kind is selected by options.
            formula: the requested model; None for the declared one.

        Raises:
            DataError: columns or values are missing, the rows do not determine the model, or the kind takes no formula.
        """

    @abstractmethod
    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """Calibrations from a file of `rig fit --out` of this kind.

        Args:
            content: of the file.
            source: its path.

        Raises:
            DataError: such a file lacks data for charts.
            ValueError, LookupError, TypeError, AttributeError, ArithmeticError: the content is invalid.
        """

    def model(self, sensor: Any) -> str:
        """The fitted model of a sensor; only calibrations of one model are charted together."""
        return str(sensor.formula)

    def apart(self, first: Any, later: Any, between: str) -> str:
        """Reason why two calibrations of one sensor and model cannot be compared; "" if they can.

        Args:
            first: the earlier one.
            later: the other.
            between: "between FILE and FILE", for the message.
        """
        return ""

    def same(self, first: Any, later: Any) -> bool:
        """Whether two calibrations of one sensor are, as far as is known, of the same data: by their coefficients."""
        return np.array_equal(first.coefficients, later.coefficients)

    def at(self, sensor: Any, degC: float) -> Any:
        """A sensor at another temperature, if it is possible."""
        return sensor

    @abstractmethod
    def view(self, every: Sequence[Any], years: FloatArray, usage: float | None) -> View:
        """One sensor over its calibrations.

        Args:
            every: m of them, of one model, in order of time.
            years: (m,) since the first.
            usage: range of use, plus and minus; None for the range of the last calibration.

        Raises:
            DataError: a range of use is given, and this kind has none.
            FitError: the calibrations cannot be charted together.
        """
