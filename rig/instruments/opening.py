"""Opening a bench: drivers, roles, locks of addresses."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from rig.bench.bench_file import of_reading
from rig.bench.plugins import driver_class, may_repeat
from rig.drivers.errors import BadReply, DriverError, NoReply, Unreachable
from rig.drivers.roles import (
    ByHand,
    Chamber,
    ChamberState,
    Head,
    Identity,
    Instrument,
    Reader,
    Source,
    WithUnits,
    plays,
)
from rig.errors import BenchFault, ConfigurationError
from rig.instruments.guarded import guarded
from rig.procedures.column_names import unit_of
from rig.units.of_instruments import PER, TEMPERATURE_UNIT, VOLT, per_volt, scale

if TYPE_CHECKING:
    from pydantic import BaseModel

    from rig.bench.config import BenchConfig
    from rig.drivers.clock import Clock
    from rig.drivers.wires import Wires
    from rig.instruments.person_at_bench import Person

Role = TypeVar("Role")

_OTHERWISE = 4
"""Identities that are asked for until two in a row are the same: noise on a line changes one, not two."""
_ASK_AGAIN_S = (1.0, 3.0)
"""Pauses before an identity is asked for again: an instrument that was just switched on needs seconds."""


@dataclass
class Bench:
    """The opened instruments by name, with their roles. Their commands are checked (`rig.instruments.guarded`).

    Attributes:
        config: the bench file.
        instruments: drivers by the bench's names.
        sensors: (instrument, channel) by output column.
        scales: unit of the output per unit of its channel, by output column.
        volts: unit of the output per volt, by output column; outputs of other units are left out.
        temperatures: (instrument, channel) by temperature column.
        references: (instrument, channel) of reference standards, by factor.
        standards: factor from the reading of its reference standard, by factor.
        answered: last identities of the instruments.
        person: a simulated person, or the bench of `rig sim`; None on a real bench.
        forecast: whether only times are wanted of it: then it is looked at less often while something settles.
        stays_on: chambers that stay at their settings when a run is complete, for the next run of its loop.
        stands: whether they do, and were watched since.
    """

    config: BenchConfig
    instruments: dict[str, Instrument]
    clock: Clock
    wires: Wires
    sensors: Mapping[str, tuple[str, str]] = field(init=False)
    scales: Mapping[str, float] = field(init=False)
    volts: Mapping[str, float] = field(init=False)
    temperatures: Mapping[str, tuple[str, str]] = field(init=False)
    references: Mapping[str, tuple[str, str]] = field(init=False)
    standards: Mapping[str, Callable[[float], float]] = field(init=False)
    answered: dict[str, Identity] = field(init=False, default_factory=dict)
    person: Person | None = field(init=False, default=None)
    forecast: bool = field(init=False, default=False)
    stays_on: frozenset[str] = field(init=False, default=frozenset())
    stands: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        limits, factors = self.config.limits, self.config.factors
        self.instruments = {
            name: guarded(name, i, limits, [factor for factor, setter in factors.items() if setter == name])
            for name, i in self.instruments.items()
        }
        sensors = {f"{name}_{s.unit}": s for name, s in self.config.sensors.items()}
        self.sensors = {column: (s.reader, s.channel) for column, s in sensors.items()}
        self.temperatures = {name: (t.reader, t.channel) for name, t in self.config.temperatures.items()}
        references = self.config.references
        self.references = {name: (r.reader, r.channel) for name, r in references.items()}
        self.standards = {name: of_reading(r.formula) for name, r in references.items()}
        self._check_channels()
        self._check_units()
        self.scales = {column: self._scale(column, s.unit) for column, s in sensors.items()}
        self.volts = {column: found for column, s in sensors.items() if (found := per_volt(s.unit)) is not None}

    def _check_units(self) -> None:
        """Refuse a standard that reads another unit than its quantity has, and has no formula that converts it."""
        for name, one in self.config.references.items():
            instrument, unit = self.instruments[one.reader], unit_of(name)
            if one.formula is not None or not isinstance(instrument, WithUnits):
                continue
            own = instrument.units()[one.channel]
            factor = scale(own, unit)
            if factor != 1.0:
                by = "FACTOR" if factor is None else f"{factor:g}"
                raise ConfigurationError(
                    f"bench {self.config.name}: references.{name}: channel {one.channel} of {one.reader} reads {own}, "
                    f'not {unit}; say how {unit} follows from it: formula = "{by} * reading"'
                )

    def _scale(self, column: str, unit: str) -> float:
        """Units of an output in one of its channel. Raises `ConfigurationError` if they are different units."""
        reader, channel = self.sensors[column]
        instrument = self.instruments[reader]
        own = instrument.units()[channel] if isinstance(instrument, WithUnits) else VOLT
        found = scale(own, unit)
        if found is None:
            what = f"bench {self.config.name}: {column}: channel {channel} of {reader} reads {own}, not {unit}"
            if PER in unit and PER not in own:
                raise ConfigurationError(
                    f"{what}; a ratio is read by a meter that gives it: name one as the reader, such as a scpi-meter "
                    f'with unit = "{unit}" (docs/how_to/own_instrument.md); {reader} can record the output in {own} '
                    f"alone"
                )
            raise ConfigurationError(f'{what}; write unit = "{own}", or that with another prefix')
        return found

    def _check_channels(self) -> None:
        for name, (reader, channel) in (*self.sensors.items(), *self.temperatures.items(), *self.references.items()):
            instrument = self.instruments[reader]
            if not isinstance(instrument, Reader):
                raise ConfigurationError(
                    f"bench {self.config.name}: {name} has the reader {reader}, which is not a reader"
                )
            if channel not in instrument.channels():
                known = ", ".join(instrument.channels())
                has = f"({known})" if known else "or any other: what a person types, `reads` names, with its unit"
                raise ConfigurationError(f"bench {self.config.name}: {name}: {reader} has no channel {channel} {has}")

    @property
    def head(self) -> Head:
        """The dividing head."""
        heads = self._playing(Head)
        if len(heads) != 1:
            raise ConfigurationError(
                f"bench {self.config.name} needs exactly one dividing head for this procedure; it has {len(heads)}"
            )
        return next(iter(heads.values()))

    def coarse(self, name: str) -> bool:
        """Whether readings of an instrument may repeat to the last digit: by the bench file, or by its own file."""
        declared = self.config.instruments[name]
        return declared.coarse or may_repeat(declared.driver)

    def by_hand(self, factor: str) -> ByHand | None:
        """The person who sets a factor; None if an instrument does."""
        instrument = self.instruments.get(self.config.setters.get(factor, ""))
        return instrument if isinstance(instrument, ByHand) else None

    def setting(self, factor: str, role: type[Role]) -> tuple[str, Role]:
        """The instrument that sets a factor, and its name. Raises `ConfigurationError` if it cannot."""
        name = self.config.setters.get(factor)
        if name is None:
            raise ConfigurationError(
                f"bench {self.config.name} does not name the instrument of {factor}: add it under [factors], "
                f'{factor} = "INSTRUMENT"'
            )
        instrument = self.instruments[name]
        if not plays(instrument, role):
            raise ConfigurationError(
                f"bench {self.config.name}: {name} cannot set {factor}: it is not a {role.__name__}"
            )
        return name, instrument

    @property
    def chambers(self) -> dict[str, Chamber]:
        """Chambers and enclosures by name, and baths: sources that set a temperature."""
        baths = {name: Bath(s) for name, s in self._playing(Source).items() if s.unit() == TEMPERATURE_UNIT}
        return {**self._playing(Chamber), **baths}

    def soaks(self, factor: str) -> tuple[str, Chamber]:
        """The chamber or bath that sets a factor, and its name. Raises `ConfigurationError` if nothing such does."""
        chambers, name = self.chambers, self.config.factors.get(factor, "")
        return (name, chambers[name]) if name in chambers else self.setting(factor, Chamber)

    @property
    def readers(self) -> dict[str, Reader]:
        """The instruments that read sensors or temperatures, by name."""
        sources = (*self.sensors.values(), *self.temperatures.values(), *self.references.values())
        used = {reader for reader, _ in sources}
        return {name: r for name, r in self._playing(Reader).items() if name in used}

    def _playing(self, role: type[Role]) -> dict[str, Role]:
        return {name: i for name, i in self.instruments.items() if plays(i, role)}

    def close(self) -> None:
        """Release every wire."""
        for instrument in self.instruments.values():
            with contextlib.suppress(DriverError, OSError):
                instrument.close()
        self.wires.close()


def open_bench(config: BenchConfig, options: Mapping[str, BaseModel], clock: Clock, wires: Wires) -> Bench:
    """Open every instrument's wire. Sends nothing. Raises `BenchFault` with the name of the failing instrument."""
    opened: dict[str, Instrument] = {}
    try:
        for name, instrument in config.instruments.items():
            cls = driver_class(instrument.driver)
            opened[name] = cls(name, instrument.address, options[name], wires, clock)
        return Bench(config, opened, clock, wires)
    except DriverError as error:
        for instrument_opened in opened.values():
            instrument_opened.close()
        wires.close()
        raise BenchFault(str(error)) from error


def identities(bench: Bench, known: Mapping[str, Mapping[str, Any]] | None = None) -> dict[str, dict[str, Any]]:
    """Ask every instrument for its identity, again if its answer is lost.

    Args:
        bench: the bench.
        known: known identities, by name, from the run file. An answer that differs from the known and from the previous
            one must come twice, since a truncated answer looks like another instrument. None: check only that they
            answer.

    Returns:
        Identities by name, as kept in the run file.

    Raises:
        DriverError: an instrument does not answer, or answers differently every time.
        BenchFault: an instrument is not the declared one.
    """
    found = {}
    for name, instrument in bench.instruments.items():
        declared = bench.config.instruments[name]
        reply = _identity(instrument, bench.clock)
        if known is not None and reply != bench.answered.get(name) and not _is(reply, known.get(name)):
            reply = _twice(name, instrument, bench.clock, reply)
        bench.answered[name] = reply
        found[name] = {
            "maker": reply.maker,
            "model": reply.model,
            "serial": reply.serial,
            "firmware": reply.firmware,
            "asset": declared.asset,
            "due": declared.due.isoformat() if declared.due else None,
            "confirmed": reply.confirmed,
        }
        if declared.serial and reply.confirmed and declared.serial != reply.serial:
            raise BenchFault(
                f"{name} at {declared.address} has serial number {reply.serial}, the bench file says "
                f"{declared.serial}: connect the declared instrument, or correct the bench file"
            )
    return found


def _is(reply: Identity, known: Mapping[str, Any] | None) -> bool:
    return known is not None and all(known[key] == getattr(reply, key) for key in ("maker", "model", "serial"))


def _twice(name: str, instrument: Instrument, clock: Clock, reply: Identity) -> Identity:
    for _ in range(_OTHERWISE):
        before, reply = reply, _identity(instrument, clock)
        if reply == before:
            return reply
    raise BadReply(
        f"{name} reports a different identity every time, last {reply.maker} {reply.model} "
        f"{reply.serial}: check its line, and that it has no other controller"
    )


def _identity(instrument: Instrument, clock: Clock) -> Identity:
    """Ask a question without side effects, again after an error."""
    for pause in _ASK_AGAIN_S:
        try:
            return instrument.identify()
        except (NoReply, BadReply, Unreachable):
            clock.sleep(pause)
    return instrument.identify()


class Bath:
    """A source in degrees Celsius with the commands and the state of a chamber (`rig.drivers.roles.Chamber`).

    Args:
        source: the instrument.
    """

    def __init__(self, source: Source) -> None:
        self._source = source

    def identify(self) -> Identity:
        """Ask for the identity. Raises `WrongInstrument` for another model, `NoReply` without an answer."""
        return self._source.identify()

    def prepare(self) -> None:
        """Set remote control, units, ranges and speeds as the bench declares them."""
        self._source.prepare()

    def make_safe(self) -> None:
        """Bring this instrument to its safe state; idempotent, and called also after errors."""
        self._source.make_safe()

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._source.close()

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, degrees Celsius."""
        return self._source.limits()

    def set_temperature(self, degC: float) -> None:
        """Command a setpoint with closed-loop control on. Raises `LimitError` before sending."""
        self._source.set(degC)

    def read(self) -> ChamberState:
        """Read its state. A source does not report its power, which is 0; its faults are alarms."""
        state = self._source.read()
        return ChamberState(state.setpoint, state.value, 0.0, state.output, state.faults)

    def stop(self) -> None:
        """Hold the present temperature: it becomes the setpoint."""
        self._source.stop()
