"""What must hold of every accepted observation, against what its sensors truly gave while it says it was measured."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from operator import attrgetter

from proving.night.judged import Night
from rig.bench.bench_file import of_reading
from rig.procedures.column_names import unit_of
from rig.procedures.plan.run_list import Factor, Point
from rig.run_file.chain import Record
from rig.run_file.events.points import WholePlotBegan
from rig.sims.physics.expression import Formula
from rig.sims.physics.laboratory_truth import AnySensorTruth, SourceTruth, StandardTruth
from rig.sims.physics.pressure_truth import TransducerTruth
from rig.sims.physics.truth import SensorTruth
from rig.sims.tape import Reading
from rig.sims.twin import Accuracy, Accurate
from rig.units.of_instruments import HEAD_AXES


def truthful(night: Night) -> Iterator[str]:
    """Every accepted reading is what its sensor truly gave, within noise, while it says it was measured, in its place.

    The number is one that the instrument then made of that input, to the last digit, and no two readings are the same
    one. And it is the truth of that moment within `_Input.bound`, whatever a fault of the input has made of it.
    """
    inputs = _inputs(night)
    for record in night.accepted():
        point = night.point(record)
        for column, values in {**record.data["outputs"], **record.data["temperatures"]}.items():
            yield from _read(night, record, point, inputs[column], values["readings"])
        for column, values in record.data.get("references", {}).items():
            if column in night.played.plan.bench.references:
                yield from _read(night, record, point, inputs[column], values["readings"])
            elif column not in stated(night, record):  # which are compared where the sensors were read
                yield from _readback(night, record, column, values["readings"])


def _read(night: Night, record: Record, point: Point, of: _Input, values: list[float]) -> Iterator[str]:
    """What is wrong with the first reading of a column with which anything is.

    A thermometer that hangs is excepted: what it repeats must have been true when it was first said, wherever that was.
    One that has never been seen to change cannot be distinguished from a coarse one; nor can an instrument with one
    input only.
    """
    made = night.of_input(of.wire)
    left = iter(night.meanwhile(record, of.wire))
    for value in values:
        at = next((i for i in left if of.says(made[i].given, value)), None)
        if at is None:
            began, ended = night.measured_s(record)
            yield f"point {point.index}: {of.column} = {value:g} was not read between {began:.1f} and {ended:.1f} s"
            return
        reading = then = made[at]
        # What a meter that hangs repeats may be from elsewhere and within the noise by chance: it must be from here.
        while at and made[at].given != made[at].found and made[at - 1].given == reading.given:
            at -= 1
            then = made[at]
        judged = then if reading.unit == "degC" else reading
        off = abs(judged.given - judged.true)
        wrong = list(_there(night, record, of.column, reading))
        unknown = at == 0 and len(set(values)) == 1 and night.alone(of.wire)
        if off > of.bound(judged) and not unknown:
            wrong.append(f"point {point.index}: {of.column} = {value:g} is off by {off:.2g} {reading.unit}")
        if reading.unit == "V":
            wrong += _there(night, record, f"{of.column}, repeated since then,", then)
        if wrong:
            yield wrong[0]
            return


def _readback(night: Night, record: Record, column: str, values: list[float]) -> Iterator[str]:
    """The pressure that the sensors are calibrated against: what the controller then said, and what was true.

    What a controller repeats that hangs has to have been true when it was first said, at this setpoint, in the band
    that a pressure has to stay in to count as settled: it is off by the width of that at most.
    """
    began, ended = night.measured_s(record)
    instrument = night.played.plan.bench.factors[column]
    made = [b for b in night.tape.readbacks if b.instrument == instrument and b.t_s <= ended]
    first = bisect_left(made, began - 1e-6, key=attrgetter("t_s"))
    bound = _SDS * night.played.bench.sim.plant.pressure_line(instrument).truth.reference_noise_psi + _DIGIT_PSI
    setpoint = night.run_list.setting(night.point(record))[column]
    band = night.played.plan.procedure.conduct.settle.band
    left = iter(range(first, len(made)))
    for value in values:
        at = next((i for i in left if abs(made[i].given - value) <= _DIGIT_PSI), None)
        if at is None:
            yield f"point {record.run_index}: {column} = {value:g} was not read between {began:.1f} and {ended:.1f} s"
            return
        now = made[at]
        while at and made[at - 1].given == now.given:
            at -= 1
        then = made[at]
        stood = then is not now and max(abs(then.given - setpoint), abs(now.true - setpoint)) <= band
        if abs(now.given - (then if stood else now).true) > bound:
            yield f"point {record.run_index}: {column} = {value:g} is off by {now.given - now.true:.2g} psi"
            return


@dataclass(frozen=True)
class _Input:
    """Where the readings of a column come from, and how far from the truth they may be.

    Attributes:
        column: its name.
        wire: (instrument, channel).
        scale: volts or degrees Celsius in its unit.
        quantity: what a reading says by the formula of the bench file, for a reference standard that has one.
        noise: standard deviation of the sensor's mean over 1 s, volts or degrees Celsius.
        accuracy: of the instrument, likewise.

    """

    column: str
    wire: tuple[str, str]
    scale: float
    noise: float
    accuracy: Accuracy
    quantity: Callable[[float], float] | None = None

    def says(self, given: float, value: float) -> bool:
        """Whether this is the value that was written down of a reading, to the last digit sent."""
        if self.quantity is not None:
            return abs(self.quantity(given) - value) <= _TEXT * max(abs(value), abs(given))
        said = value * self.scale
        return abs(given - said) <= self.accuracy.digit + _TEXT * abs(said)

    def bound(self, reading: Reading) -> float:
        """How far a reading may be from the truth."""
        return _SDS * self.noise / sqrt(reading.end_s - reading.t_s) + self.accuracy.adds


def _noise_volts(truth: TransducerTruth | SensorTruth | AnySensorTruth, scale: float) -> float:
    """Standard deviation of a sensor's mean over 1 s; `scale` is the number of volts in its unit on the bench."""
    match truth:
        case TransducerTruth():
            return truth.noise_mV * 1e-3
        case SensorTruth():
            return truth.noise_V
    return truth.noise * scale


def _inputs(night: Night) -> dict[str, _Input]:
    """Of every column that is recorded."""
    bench, sim = night.played.plan.bench, night.played.bench.sim
    truth, found = sim.plant.truth, []

    def accuracy(reader: str, channel: str, unit: str) -> Accuracy:
        twin = sim.twin(reader)
        assert isinstance(twin, Accurate), f"the twin of {reader} does not say how well it reads"
        return twin.accuracy(channel, unit)

    for name, sensor in bench.sensors.items():
        true = truth.sensors[name]
        scale = 1e-3 if sensor.unit == "mV" else 1.0
        noise = _noise_volts(true, scale)
        wire = (sensor.reader, sensor.channel)
        found.append(_Input(f"{name}_{sensor.unit}", wire, scale, noise, accuracy(*wire, "V")))
    for column, at in bench.temperatures.items():
        wire = (at.reader, at.channel)
        found.append(_Input(column, wire, 1.0, 0.0, accuracy(*wire, "degC")))
    for column, reference in bench.references.items():
        wire = (reference.reader, reference.channel)
        noise = truth.references.get(column, StandardTruth()).noise
        quantity = None if reference.formula is None else of_reading(reference.formula)
        found.append(_Input(column, wire, 1.0, noise, accuracy(*wire, "V"), quantity))
    return {one.column: one for one in found}


_SDS = 6.0
"""Once in 500 million readings chance goes further."""

_TEXT = 6e-9
"""Of a number that is sent with nine digits."""

_DIGIT_PSI = 1e-7

_THERE = {"deg": 0.003, "psia": 0.02}
"""How far the truth may be from the setpoint: band, encoder and reference errors and control noise."""


def stated(night: Night, record: Record) -> dict[str, float]:
    """Values that a person stated for the factors of an observation: these are where it was made."""
    bench = night.played.plan.bench
    people = {factor for factor, name in bench.factors.items() if bench.instruments[name].driver == "person"}
    references = record.data.get("references", {})
    return {factor: references[factor]["mean"] for factor in people & references.keys()}


def _there(night: Night, record: Record, column: str, reading: Reading) -> Iterator[str]:
    point, said = night.point(record), stated(night, record)
    standard = column.partition(",")[0] in night.played.plan.bench.references  # of its own factor only
    for factor, planned in zip(night.run_list.factors, point.setpoints, strict=True):
        setpoint = said.get(factor.name, planned)
        if factor.hard or standard:
            continue
        is_at = reading.factors[factor.name]
        if abs(is_at - _truly(night, factor.name, setpoint)) > _near(night, factor):
            yield f"point {point.index}: {column} was read with {factor.name} at {is_at:g}, not at {setpoint:g}"


def _truly(night: Night, factor: str, setpoint: float) -> float:
    """What a source or a person truly makes of a setpoint."""
    text = night.played.bench.sim.plant.truth.sources.get(factor, SourceTruth()).formula
    return Formula.parse(text, factor, {"set"}).value({"set": setpoint}) if text else setpoint


def _near(night: Night, factor: Factor) -> float:
    """How far the truth may be from that: nothing where a person sets it; the band in which a source has settled."""
    name = night.played.plan.bench.factors.get(factor.name)  # None of the angles of a head
    unit = unit_of(factor.name)
    if unit in _THERE and (name is None or "source" not in night.played.bench.sim.twin(name).roles):
        return _THERE[unit]
    assert name is not None
    if night.played.plan.bench.instruments[name].driver == "person":
        return _OF_WEIGHTS
    return night.played.plan.procedure.conduct.settled(factor.axis).band


_OF_WEIGHTS = 1e-9


def _seen(night: Night, record: Record) -> list[Reading]:
    """What was made of the first sensor's input while an observation says that it was measured."""
    first = next(iter(night.played.plan.bench.sensors.values()))
    wire = (first.reader, first.channel)
    made = night.of_input(wire)
    return [made[i] for i in night.meanwhile(record, wire)]


def approached(night: Night) -> Iterator[str]:
    """Every reading was taken where the axis had truly come from its planned side, from far enough."""
    for record in night.accepted():
        point, seen = night.point(record), _seen(night, record)
        for factor, side, setpoint in zip(night.run_list.factors, point.sides, point.setpoints, strict=True):
            if not side:
                continue
            arrived, start = _approach(night, record, factor).get(factor.axis, (0, setpoint))
            truly = {reading.sides[factor.name] for reading in seen} - {0}
            if arrived != side or truly - {side}:
                sides = " and ".join(map(str, sorted(truly))) or "neither"
                said = f"truly from side {sides}, recorded from {arrived}, planned from {side}"
                yield f"point {point.index}: {factor.axis} came {said}"
            elif (setpoint - start) * side < 0.9 * factor.overtravel:
                yield f"point {point.index}: {factor.axis} came from {start:g}, nearer than its overtravel"


def _approach(night: Night, record: Record, factor: Factor) -> Mapping[str, Sequence[float]]:
    """Recorded approaches: of the point, or of the whole plot where it is hard to change."""
    approach: Mapping[str, Sequence[float]] = record.data["approach"]
    if factor.hard:
        plots = (r.event for r in night.records if r.whole_plot == record.whole_plot)
        approach = next(event.approach for event in plots if isinstance(event, WholePlotBegan))
    return approach


def one_stay(night: Night) -> Iterator[str]:
    """Observations of one whole-plot identity share one stay at its temperatures; another identity is another stay."""
    if not night.run_list.hard:
        return
    stays: dict[int, set[int]] = {}
    for record in night.accepted():
        assert record.whole_plot is not None
        seen = _seen(night, record)
        stays.setdefault(record.whole_plot, set()).update(reading.stay for reading in seen)
        setting = night.run_list.setting(night.point(record))
        for factor in night.run_list.hard:
            chamber, wanted = night.played.plan.bench.factors.get(factor.name, ""), setting[factor.name]
            most = _NEAR_OF_ANGLES if factor.axis in HEAD_AXES else _AIR_DEGC
            there = (reading.air_degC.get(chamber, reading.factors.get(factor.name, wanted)) for reading in seen)
            air = max(there, key=lambda a: abs(a - wanted), default=wanted)
            if abs(air - wanted) > most:
                yield f"point {record.run_index}: {factor.name} was truly {air:.4f}, not {wanted:g}"
    owners: dict[int, int] = {}
    for identity, truly in stays.items():
        if len(truly) > 1:
            yield f"whole plot {identity} has observations of {len(truly)} stays at its temperatures"
        for stay in truly:
            if owners.setdefault(stay, identity) != identity:
                yield f"whole plots {owners[stay]} and {identity} are one stay at one pair of temperatures"


_NEAR_OF_ANGLES = _THERE["deg"]
_AIR_DEGC = 0.6
