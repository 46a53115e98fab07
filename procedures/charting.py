"""What control charts ask of a kind: its calibrations of a table or a file, and one sensor over several of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.history import Charted
from procedures.table import Table


@dataclass(frozen=True, eq=False)
class Calibrations:
    """The sensors of one calibration.

    Attributes:
        sensors: by output column, as their kind has them.
        effects: names of the effects fitted beside the model, by output column.
        simulated: from a simulated run.
        provenance: what is known of it.
        degC: mean sensor temperature; None where it was not recorded, or does not matter to what is charted.
        corrected: whether `Charting.at` can bring every sensor to another temperature.

    """

    sensors: Mapping[str, Any]
    effects: Mapping[str, tuple[str, ...]]
    simulated: bool
    provenance: Mapping[str, Any]
    degC: float | None = None
    corrected: bool = False


@dataclass(frozen=True)
class Shown:
    """How changes of one charted parameter are shown.

    Attributes:
        label: of the parameter, for people.
        scale: what a change is multiplied by.
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
        rows: (H, q) what a unit of each charted parameter adds to the output over the range of use.
        model: that was fitted.
        unit: of the output.
        drawn: unit of plots of the output's error, and how many of them one `unit` is.
        usage: range that the error of the output is bounded over.
        usage_words: the same for people.
        interval: half-width of the 95 % interval of one reading, at its widest.
        remarks: what a reader should know.

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
    """What a kind knows of calibrations to chart; sensors are those of its `Calibrations`.

    Attributes:
        at_one_temperature: whether the charted parameters hold at one temperature of the sensor.

    """

    at_one_temperature = False

    @abstractmethod
    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """Calibrate every sensor of a table.

        Args:
            table: of this kind; of no kind that is known where the kind is asked for by options.
            formula: the model that was asked for; None for the declared one.

        Raises:
            DataError: the table lacks something, its rows do not determine the model, or no model can be asked for.

        """

    @abstractmethod
    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """What `rig fit --out` wrote of this kind.

        Args:
            content: of the file.
            source: its path.

        Raises:
            DataError: such a file does not keep all that charts need.
            ValueError, LookupError, TypeError, AttributeError, ArithmeticError: the content is garbled.

        """

    def model(self, sensor: Any) -> str:
        """What was fitted to a sensor; only calibrations of one model are charted together."""
        return str(sensor.formula)

    def apart(self, first: Any, later: Any, between: str) -> str:
        """Why two calibrations of one sensor and model cannot be compared; "" if they can.

        Args:
            first: the earlier one.
            later: the other.
            between: "between FILE and FILE", to be said.

        """
        return ""

    def same(self, first: Any, later: Any) -> bool:
        """Whether two calibrations of one sensor are, as far as is known, of the same data: by their coefficients."""
        return np.array_equal(first.coefficients, later.coefficients)

    def at(self, sensor: Any, degC: float) -> Any:
        """A sensor at another temperature, where that can be told."""
        return sensor

    @abstractmethod
    def view(self, every: Sequence[Any], years: FloatArray, usage: float | None) -> View:
        """One sensor over its calibrations.

        Args:
            every: m of them, of one model, in order of time.
            years: (m,) since the first.
            usage: it is used within +- this; None for the range calibrated last.

        Raises:
            DataError: a range of usage is given, and this kind knows of none.
            FitError: the calibrations cannot be charted together.

        """
