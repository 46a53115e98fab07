"""Consistency of instruments: identities, readings and final states agree with the bench file and are physically
possible.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import date
from typing import Any

from rig.bench.config import InstrumentConfig
from rig.bench.plugins import driver_class
from rig.errors import ConfigurationError
from rig.run_file.chain import Record
from rig.run_file.events.bench import AsFound, Homed, MadeSafe, ReadBack
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed
from rig.run_file.events.sessions import Held, Identified, SessionBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import RecordedRun
from rig.units.of_instruments import per_volt

_ABSOLUTE_ZERO_DEGC = -273.15
_OVER_RANGE = 1.21
"""Largest reading of a meter, relative to its range; beyond that it reports an overload."""
_ROUNDING = 1e-6


class Instruments:
    """Checks identities, ends of scales, and the found states of axes and of the safe state.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._bench = case.bench
        self._most: dict[str, float] = {}
        if case.bench is not None:
            for name, sensor in case.bench.sensors.items():
                range_V = _measuring_range(case.bench.instruments[sensor.reader], sensor.channel)
                scale = per_volt(sensor.unit)
                if range_V is not None and scale is not None:
                    self._most[f"{name}_{sensor.unit}"] = _OVER_RANGE * range_V * scale
        self._chambers: set[str] = set()
        self._not_homed: list[str] = []
        self._writes_all = False

    def look(self, record: Record, event: Event, _fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        match event:
            case SessionBegan():
                self._writes_all = event.writes_all
                self._chambers, self._not_homed = set(), []
            case Identified():
                yield from self._identity(record, event)
            case AsFound() | ReadBack():
                self._chambers = set(event.chambers)
                self._not_homed = [axis for axis, found in event.axes.items() if not found.get("homed", True)]
            case Homed() | Held():  # during a hold somebody may home it
                self._not_homed = []
            case MadeSafe():
                yield from self._safe(event)
            case Observed():
                yield from self._observed(event)

    def _identity(self, record: Record, event: Identified) -> Iterator[str]:
        name = event.instrument
        if not (event.maker and event.model):
            yield f"it does not say who {name} is"
        if event.due is not None and not _is_date(event.due):
            yield f"{event.due} is no date on which the calibration of {name} is due"
        declared = None if self._bench is None else self._bench.instruments.get(name)
        if declared is None or event.replaces is not None or record.session > 1:  # the bench file may have changed then
            return
        due = declared.due.isoformat() if declared.due else None
        for what, said, stands in (("asset", event.asset, declared.asset), ("due", event.due, due)):
            if said != stands:
                yield f"{what} of {name} is {said or 'nothing'}, the bench file says {stands or 'nothing'}"
        if declared.serial and event.confirmed and event.serial != declared.serial:
            yield f"serial number of {name} is {event.serial}, the bench file says {declared.serial}"

    def _observed(self, event: Observed) -> Iterator[str]:
        if self._not_homed and event.accepted:
            yield f"{' and '.join(self._not_homed)} had not been homed"
            self._not_homed = []  # told once
        for name, channel in event.outputs.items():
            most = self._most.get(name)
            if most is not None and any(abs(reading) > most for reading in channel["readings"]):
                yield f"{name} read more than its instrument can show in its range ({most:g} at most)"
        seen = [(name, channel["readings"]) for name, channel in event.temperatures.items()]
        seen += [(name, (state["temperature_degC"],)) for name, state in event.environment.items()]
        for name, degrees in seen:
            if any(degC < _ABSOLUTE_ZERO_DEGC for degC in degrees):
                yield f"{name} read less than absolute zero"
        if self._writes_all and event.accepted and (unseen := sorted(self._chambers - event.environment.keys())):
            yield f"it does not say at what temperature {', '.join(unseen)} was"

    def _safe(self, event: MadeSafe) -> Iterator[str]:
        """Check that every readback is safe, or that its instrument is named as unsafe."""
        if self._bench is None:
            return
        told = {words.partition(":")[0] for words in (*event.unsafe, *event.silent)}
        for name, found in event.found.items():
            if name not in told:
                yield from self._left(name, found)

    def _left(self, name: str, found: Mapping[str, Any]) -> Iterator[str]:
        assert self._bench is not None
        safety = self._bench.safety
        if found.get("safe") is False:
            yield f"{name} was still on, and it is not named as unsafe"
        if found.get("controlling"):
            yield f"{name} still controlled pressure, and it is not named as unsafe"
        for what, (low, high), unit in (
            ("setpoint_degC", safety.ambient_degC, "degC"),
            ("pressure_psia", safety.ambient_psia, "psia"),
        ):
            value = found.get(what)
            if value is not None and not low - _ROUNDING <= value <= high + _ROUNDING:
                yield f"{name} was left at {value:g} {unit}, not {low:g} to {high:g}, and it is not named as unsafe"


def _measuring_range(instrument: InstrumentConfig, channel: str) -> float | None:
    """Measuring range of a channel, volts; None if its driver has none."""
    own = instrument.options.get("ranges", {}).get(channel)
    if own is None:
        own = instrument.options.get("range_V")
    if own is None:
        try:
            fields = driver_class(instrument.driver).Options.model_fields
        except ConfigurationError:
            return None
        own = fields["range_V"].default if "range_V" in fields else None
    return float(own) if isinstance(own, int | float) else None


def _is_date(text: str) -> bool:
    try:
        date.fromisoformat(text)
    except ValueError:
        return False
    return True
