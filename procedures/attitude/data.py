"""Data of a run as arrays: the only input of the fitter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any, Generic, TypeVar, overload

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.checked import finite, whole
from rig.fitter.errors import FitError
from rig.fitter.replication import Rows
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.model import attitude_columns

SAME_ANGLE_DEG = 0.02
"""Angles closer than this are one setting of the head: far above readback noise, far below a design's step."""


Number = TypeVar("Number", np.int64, np.float64)


class FromOrder(Generic[Number]):
    """A field (n,) of the data that follows from the executed order if it is not given: made when it is asked for."""

    made: Callable[[AttitudeData], np.ndarray[Any, np.dtype[Number]]]
    name: str

    def __init__(self, made: Callable[[AttitudeData], np.ndarray[Any, np.dtype[Number]]]) -> None:
        self.made = made

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, data: None, owner: type) -> None: ...
    @overload
    def __get__(self, data: AttitudeData, owner: type) -> np.ndarray[Any, np.dtype[Number]]: ...
    def __get__(self, data: AttitudeData | None, owner: type) -> np.ndarray[Any, np.dtype[Number]] | None:
        if data is None:
            return None  # default of the field
        known: np.ndarray[Any, np.dtype[Number]] | None = data.__dict__[self.name]
        if known is None:
            known = data.__dict__[self.name] = self.made(data)
        return known

    def __set__(self, data: AttitudeData, given: np.ndarray[Any, np.dtype[Number]] | None) -> None:
        data.__dict__[self.name] = given


@dataclass(frozen=True, eq=False)
class AttitudeData:
    """Observations of a pitch-roll calibration, one row each, in any order.

    Attributes:
        replicate: (n,) number of the pass over the design.
        order: (n,) executed position over the whole run, unique.
        elapsed_s: (n,) seconds since the start of the run.
        pitch_deg: (n,) angles of the head.
        roll_deg: (n,) zero throughout for a calibration without roll.
        sensor_temperature_degC: (n,), or None if it was not recorded; temperature effects then cannot be tested.
        outputs: volts by column name.
        pitch_side: (n,) +1 arrived upwards, -1 downwards, 0 unknown. Default: from the executed order.
        roll_side: (n,) the same for roll.
        previous_pitch_deg: (n,) angles at the previous observation in executed order; at the first one that from
            which the head came, its own where that is not known. Default: from the executed order.
        previous_roll_deg: (n,) the same for roll.
        block: (n,) number that increases where an interruption or a replaced instrument may cause a step. Default: one
            block.
        axes: "x", "y" or "z" by column name, the nominal axis a sensor is mounted along. For other outputs: the first
            letter of the name ("x_V"), or the axis of the largest sensitivity.
        mounting: (n, 3, 3) rotation from the axes of the head's table to those of the package, if the package was
            mounted with another orientation; None if the two are the same. The declared model is in axes of the table,
            whatever the mounting; effects of package and sensors are in those of the package.

    Raises:
        ValueError: lengths differ, a value is not finite, an order is used twice, there is nothing to fit, or an axis
            is none of x, y, z or belongs to a missing output.
    """

    replicate: IntArray
    order: IntArray
    elapsed_s: FloatArray
    pitch_deg: FloatArray
    roll_deg: FloatArray
    sensor_temperature_degC: FloatArray | None
    outputs: Mapping[str, FloatArray]
    pitch_side: FromOrder[np.int64] = FromOrder(lambda data: data._side_from_order(data.pitch_deg))
    roll_side: FromOrder[np.int64] = FromOrder(lambda data: data._side_from_order(data.roll_deg))
    previous_pitch_deg: FromOrder[np.float64] = FromOrder(lambda data: data._previous(data.pitch_deg))
    previous_roll_deg: FromOrder[np.float64] = FromOrder(lambda data: data._previous(data.roll_deg))
    block: IntArray = field(default=None)  # type: ignore[arg-type]  # None only until __post_init__
    axes: Mapping[str, str] | None = None
    mounting: FloatArray | None = None
    temperatures: tuple[FloatArray, FloatArray] | None = field(init=False, default=None)
    """Seconds, ascending, and degC of the whole run, also for a subset of rows: input of a lag."""
    lags: dict[float, FloatArray] = field(init=False, default_factory=dict)
    """These behind a lag, degC, by its seconds, as far as they have been computed."""

    def __post_init__(self) -> None:
        count = np.size(self.order)
        if count == 0:
            raise FitError("there are no observations")
        put = object.__setattr__
        for name in ("replicate", "order"):
            put(self, name, whole(name, getattr(self, name), count))
        for name in ("elapsed_s", "pitch_deg", "roll_deg"):
            put(self, name, finite(name, getattr(self, name), count))
        if self.sensor_temperature_degC is not None:
            temperature = finite("sensor_temperature_degC", self.sensor_temperature_degC, count)
            put(self, "sensor_temperature_degC", temperature)
        if not self.outputs:
            raise FitError("there is no sensor output to fit")
        put(self, "outputs", MappingProxyType({name: finite(name, v, count) for name, v in self.outputs.items()}))
        if np.unique(self.order).size != count:
            raise FitError("order: two observations have the same executed position")
        for name in ("pitch_side", "roll_side"):
            if (given := self.__dict__[name]) is not None:
                put(self, name, np.sign(whole(name, given, count)))
        for name in ("previous_pitch_deg", "previous_roll_deg"):
            if (given := self.__dict__[name]) is not None:
                put(self, name, finite(name, given, count))
        if self.sensor_temperature_degC is not None:
            at, degC = self.elapsed_s, self.sensor_temperature_degC
            if np.any(np.diff(at) < 0):
                ahead = np.argsort(at, kind="stable")
                at, degC = at[ahead], degC[ahead]
            put(self, "temperatures", (at, degC))
        put(self, "block", np.zeros(count, np.int64) if self.block is None else whole("block", self.block, count))
        if self.axes is not None:
            put(self, "axes", MappingProxyType(_axes(self.axes, self.outputs)))
        if self.mounting is not None and np.shape(self.mounting) != (count, 3, 3):
            raise ValueError(f"mounting: {np.shape(self.mounting)} is not one rotation, 3 by 3, for each observation")

    def __len__(self) -> int:
        return int(self.order.size)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.outputs)

    @property
    def replicates(self) -> IntArray:
        """(n_rep,) numbers of the replications, ascending."""
        return self._replication[0]

    @property
    def replicate_index(self) -> IntArray:
        """(n,) position of each row's replication in `replicates`."""
        return self._replication[1]

    @cached_property
    def _replication(self) -> tuple[IntArray, IntArray]:
        values, index = np.unique(self.replicate, return_inverse=True)
        return values, index.astype(np.int64)

    @cached_property
    def has_roll(self) -> bool:
        """Whether there was more than one roll angle (+180 and -180 deg are one)."""
        return np.unique(settings(_wrap(self.roll_deg))).size > 1

    @cached_property
    def rows(self) -> Rows:
        """Rows of the declared model, for Table 2."""
        columns = attitude_columns(self.pitch_deg, self.roll_deg, roll=self.has_roll)
        return Rows(columns, self.point, self.replicate_index, self.order)

    @cached_property
    def turned(self) -> FloatArray | None:
        """(n, 3, 3) `mounting` and a constant roll other than zero; None for neither."""
        roll = float(self.roll_deg[0])
        if self.has_roll or abs(roll) <= SAME_ANGLE_DEG:
            return self.mounting
        ((s,), (c,)) = sin_cos(np.array([roll]))
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        return np.broadcast_to(about_x, (len(self), 3, 3)) if self.mounting is None else self.mounting @ about_x

    @cached_property
    def g_M(self) -> FloatArray:  # noqa: N802 - the paper's symbol
        """(n, 3) gravity in package axes, in g: [sin a, -sin R cos a, -cos R cos a] (eq. 113)."""
        (sin_a, cos_a), (sin_r, cos_r) = sin_cos(self.pitch_deg), sin_cos(self.roll_deg)
        return np.column_stack([sin_a, -sin_r * cos_a, -cos_r * cos_a])

    @cached_property
    def point(self) -> IntArray:
        """(n,) index of each row's point of the design, from 0.

        A point is a pair of head angles and, if one replication visits the pair more than once, the number of the
        visit: a pass up and back has 2 N - 1 or 2 N points for N angles, as in Table 2 of NASA/TP-1999-209835.
        """
        pair = settings(self.pitch_deg) * (1 + len(self)) + settings(self.roll_deg)
        executed = np.lexsort((self.order, pair, self.replicate_index))
        new = np.diff(pair[executed], prepend=-1) != 0
        new |= np.diff(self.replicate_index[executed], prepend=-1) != 0
        start = np.maximum.accumulate(np.where(new, np.arange(len(self)), 0))
        visit = np.empty(len(self), np.int64)
        visit[executed] = np.arange(len(self)) - start
        return _number(_number(pair) * (1 + visit.max()) + visit)

    @cached_property
    def attitude(self) -> IntArray:
        """(n,) index of each row's attitude, from 0; several pairs of head angles can give one attitude.

        (a, R) and (180 - a, R + 180) are one attitude, +180 and -180 deg are one angle, and at a = +-90 deg roll turns
        the package about gravity and changes nothing.
        """
        a, r = _wrap(self.pitch_deg), self.roll_deg
        over = np.abs(a) > 90.0 + SAME_ANGLE_DEG
        a, r = np.where(over, np.sign(a) * 180.0 - a, a), np.where(over, r + 180.0, r)
        r = _wrap(np.where(np.abs(np.abs(a) - 90.0) <= SAME_ANGLE_DEG, 0.0, r))
        pair = settings(a) * (1 + len(self)) + settings(r)
        return _number(pair)

    def take(self, rows: IntArray) -> AttitudeData:
        """The observations at `rows` (indices or a mask); sides, blocks and previous angles are those of the
        whole run.
        """
        if rows.dtype.kind == "i" and len(rows) == len(self) and np.array_equal(rows, np.arange(len(self))):
            return self  # a copy of a million rows is as much memory as the table
        given = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        picked: dict[str, Any] = {name: v[rows] if isinstance(v, np.ndarray) else v for name, v in given.items()}
        picked["outputs"] = {name: v[rows] for name, v in self.outputs.items()}
        part = AttitudeData(**picked)
        for name in ("temperatures", "lags"):
            object.__setattr__(part, name, getattr(self, name))
        return part

    def _previous(self, angle: FloatArray) -> FloatArray:
        executed = np.argsort(self.order)
        before = np.empty_like(angle)
        before[executed] = angle[np.concatenate([executed[:1], executed[:-1]])]
        return before

    def _side_from_order(self, angle: FloatArray) -> IntArray:
        executed = np.argsort(self.order)
        moves = np.diff(angle[executed], prepend=angle[executed[0]])
        moves = np.where(np.abs(moves) < SAME_ANGLE_DEG, 0.0, np.sign(moves))
        last = np.maximum.accumulate(np.where(moves != 0, np.arange(len(self)), 0))
        side = np.empty(len(self), np.int64)
        side[executed] = moves[last].astype(np.int64)
        return side


def _axes(axes: Mapping[str, str], outputs: Mapping[str, FloatArray]) -> dict[str, str]:
    for name, axis in axes.items():
        if axis not in ("x", "y", "z"):
            raise FitError(f"axes: {name} is along {axis!r}, not x, y or z")
        if name not in outputs:
            raise FitError(f"axes: there is no output {name}, only {', '.join(outputs)}")
    return dict(axes)


def _number(code: IntArray) -> IntArray:
    """(n,) the same classes as `code`, numbered from 0."""
    return np.asarray(np.unique(code, return_inverse=True)[1], np.int64)


def _wrap(angle_deg: FloatArray) -> FloatArray:
    """Angles in [-180, 180), with those within the tolerance of +180 deg set to -180 deg."""
    wrapped = np.mod(angle_deg + 180.0, 360.0) - 180.0
    return np.where(wrapped > 180.0 - SAME_ANGLE_DEG, wrapped - 360.0, wrapped)


def settings(angle_deg: FloatArray) -> IntArray:
    """(n,) settings of an axis, numbered from 0: sorted angles are split at gaps larger than noise."""
    by_angle = np.argsort(angle_deg, kind="stable")
    setting = np.empty(angle_deg.size, np.int64)
    setting[by_angle] = np.cumsum(np.diff(angle_deg[by_angle], prepend=angle_deg[by_angle[0]]) > SAME_ANGLE_DEG)
    return setting
