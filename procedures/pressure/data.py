"""Data of a whole-plot calibration as arrays: pressures at temperatures that are hard to change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.checked import finite, whole
from rig.fitter.errors import FitError

SAME_PRESSURE_PSIA = 0.005
"""Readbacks closer than this are one setting: above a controller's noise, far below a design's step."""

SAME_TEMPERATURE_DEGC = 2.0
"""Whole plots with closer mean temperatures have the same setting: above the tolerance of a soak."""

_MEASURED = ("elapsed_s", "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
_SETTINGS = ("pressure_set_psia", "sensor_set_degC", "sse_set_degC")


@dataclass(frozen=True, eq=False)
class WholePlotData:
    """Observations of a whole-plot calibration, one row each, in any order.

    The arguments after `replicate` are optional. The last four are by default computed from the executed order within
    each whole plot; `take` keeps their values of the whole run.

    Attributes:
        whole_plot: (n,) identity of the whole plot, any whole numbers. It is independent of temperatures: the same
            temperatures set again are another whole plot.
        order: (n,) executed position over the whole run, unique.
        elapsed_s: (n,) seconds since the start of the run.
        pressure_psia: (n,) absolute pressure applied.
        sensor_temperature_degC: (n,) of the transducer.
        sse_temperature_degC: (n,) of the sensor support electronics.
        outputs: millivolts by column name.
        replicate: (n,) number of the pass over the design. Default: one.
        pressure_set_psia: (n,) nominal levels, used only to find repeats; by default readbacks are grouped.
        sensor_set_degC: (n,) the same for the sensor's temperature.
        sse_set_degC: (n,) the same for the electronics'.
        block: (n,) number that increases where an interruption or a replaced instrument may cause a step. Default: one
            block.
        pressure_side: (n,) +1 from a lower pressure, -1 from a higher one, 0 unknown. By default from the order: 0 for
            the first of a whole plot, and a repeated pressure keeps its side.
        previous_pressure_psia: (n,) pressure of the previous observation; of the first of a whole plot that from which
            it was set, NaN where that is not known.
        position: (n,) in the executed order of the whole plot, from 0.
        since_s: (n,) seconds since the first observation of the whole plot.

    Raises:
        FitError: lengths differ, a value is not finite, an order is used twice, a whole plot is in two replications, or
            there is nothing to fit.
    """

    whole_plot: IntArray
    order: IntArray
    elapsed_s: FloatArray
    pressure_psia: FloatArray
    sensor_temperature_degC: FloatArray
    sse_temperature_degC: FloatArray
    outputs: Mapping[str, FloatArray]
    replicate: IntArray = None  # type: ignore[assignment]  # None only until __post_init__
    pressure_set_psia: FloatArray | None = None
    sensor_set_degC: FloatArray | None = None
    sse_set_degC: FloatArray | None = None
    block: IntArray = None  # type: ignore[assignment]  # None only until __post_init__
    pressure_side: IntArray = None  # type: ignore[assignment]  # None only until __post_init__
    previous_pressure_psia: FloatArray = None  # type: ignore[assignment]  # None only until __post_init__
    position: IntArray = None  # type: ignore[assignment]  # None only until __post_init__
    since_s: FloatArray = None  # type: ignore[assignment]  # None only until __post_init__

    def __post_init__(self) -> None:
        count = np.size(self.order)
        if count == 0:
            raise FitError("there are no observations")
        put = object.__setattr__
        for name in ("whole_plot", "order"):
            put(self, name, whole(name, getattr(self, name), count))
        for name in _MEASURED:
            put(self, name, finite(name, getattr(self, name), count))
        for name in _SETTINGS:
            if getattr(self, name) is not None:
                put(self, name, finite(name, getattr(self, name), count))
        for name in ("replicate", "block"):
            given = getattr(self, name)
            put(self, name, np.zeros(count, np.int64) if given is None else whole(name, given, count))
        if not self.outputs:
            raise FitError("there is no transducer output to fit")
        put(self, "outputs", MappingProxyType({name: finite(name, v, count) for name, v in self.outputs.items()}))
        self._check()
        for name, derived in self._from_order().items():
            given = getattr(self, name)
            put(self, name, derived if given is None else np.asarray(given, derived.dtype))

    def _check(self) -> None:
        if np.unique(self.order).size != len(self):
            raise FitError("order: two observations have the same executed position")
        pairs = np.unique(np.column_stack([self.whole_plot, self.replicate]), axis=0)
        twice = np.flatnonzero(np.diff(pairs[:, 0]) == 0)
        if twice.size:
            raise FitError(
                f"whole plot {pairs[twice[0], 0]} is in two replications; every replication has its own whole plots"
            )

    def __len__(self) -> int:
        return int(self.order.size)

    @property
    def transducers(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.outputs)

    @property
    def whole_plots(self) -> IntArray:
        """(W,) identities of the whole plots, ascending."""
        return self._identity[0]

    @property
    def whole_plot_index(self) -> IntArray:
        """(n,) index of each row's whole plot in `whole_plots`."""
        return self._identity[1]

    @cached_property
    def _identity(self) -> tuple[IntArray, IntArray]:
        values, index = np.unique(self.whole_plot, return_inverse=True)
        return values, index.astype(np.int64)

    @cached_property
    def pressure_levels(self) -> tuple[FloatArray, IntArray]:
        """Nominal pressures (m,), ascending, and the index of each row's, (n,).

        They are the set pressures, if recorded; otherwise readbacks closer than `SAME_PRESSURE_PSIA` to a neighbour are
        one level, at their median.
        """
        if self.pressure_set_psia is not None:
            levels, level = np.unique(self.pressure_set_psia, return_inverse=True)
            return levels, level.astype(np.int64)
        ascending = np.argsort(self.pressure_psia, kind="stable")
        steps = np.diff(self.pressure_psia[ascending], prepend=self.pressure_psia[ascending[0]])
        index = np.empty(len(self), np.int64)
        index[ascending] = np.cumsum(steps > SAME_PRESSURE_PSIA)
        return np.array([np.median(self.pressure_psia[index == i]) for i in range(index.max() + 1)]), index

    @cached_property
    def nominal(self) -> Mapping[str, FloatArray]:
        """Set values of P, T_sensor and T_SSE: settings of the design, without scatter of readbacks. Temperatures are
        the set ones, if recorded; otherwise whole plots closer than `SAME_TEMPERATURE_DEGC` to a neighbour have one
        temperature, to a degree.
        """
        levels, level = self.pressure_levels
        return MappingProxyType(
            {
                "P": levels[level],
                "T_sensor": self._set_temperature(self.sensor_set_degC, self.sensor_temperature_degC),
                "T_SSE": self._set_temperature(self.sse_set_degC, self.sse_temperature_degC),
            }
        )

    def _set_temperature(self, given: FloatArray | None, measured: FloatArray) -> FloatArray:
        if given is not None:
            return given
        index = self.whole_plot_index
        mean = np.bincount(index, measured) / np.bincount(index)
        ascending = np.argsort(mean, kind="stable")
        level = np.empty(len(mean), np.int64)
        level[ascending] = np.cumsum(np.diff(mean[ascending], prepend=mean[ascending[0]]) > SAME_TEMPERATURE_DEGC)
        return np.asarray(np.round(np.bincount(level, mean) / np.bincount(level))[level][index])

    @cached_property
    def table(self) -> Mapping[str, FloatArray]:
        """Columns by the names that formulas may use: those of the fields, and P, T_sensor and T_SSE."""
        return MappingProxyType(
            {
                "P": self.pressure_psia,
                "T_sensor": self.sensor_temperature_degC,
                "T_SSE": self.sse_temperature_degC,
                "pressure_psia": self.pressure_psia,
                "sensor_temperature_degC": self.sensor_temperature_degC,
                "sse_temperature_degC": self.sse_temperature_degC,
                "elapsed_s": self.elapsed_s,
                "since_s": self.since_s,
                "order": self.order.astype(np.float64),
                "position": self.position.astype(np.float64),
                "pressure_side": self.pressure_side.astype(np.float64),
                "replicate": self.replicate.astype(np.float64),
                "block": self.block.astype(np.float64),
            }
        )

    def take(self, rows: IntArray) -> WholePlotData:
        """The observations at `rows` (indices or a mask), with sides, positions and blocks of the whole run."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        picked: dict[str, Any] = {name: v[rows] if isinstance(v, np.ndarray) else v for name, v in given.items()}
        picked["outputs"] = {name: v[rows] for name, v in self.outputs.items()}
        return WholePlotData(**picked)

    def _from_order(self) -> dict[str, FloatArray | IntArray]:
        n = len(self)
        executed = np.lexsort((self.order, self.whole_plot_index))
        first = np.diff(self.whole_plot_index[executed], prepend=-1) != 0
        start = np.maximum.accumulate(np.where(first, np.arange(n), 0))
        at = self.pressure_psia[executed]
        before = np.where(first, np.nan, np.roll(at, 1))
        moved = np.where(np.abs(at - before) > SAME_PRESSURE_PSIA, np.sign(at - before), 0.0)
        last_move = np.maximum.accumulate(np.where((moved != 0) | first, np.arange(n), 0))
        derived = {
            "pressure_side": moved[last_move].astype(np.int64),
            "previous_pressure_psia": before,
            "position": np.arange(n) - start,
            "since_s": self.elapsed_s[executed] - self.elapsed_s[executed][start],
        }
        as_given = np.argsort(executed)
        return {name: values[as_given] for name, values in derived.items()}
