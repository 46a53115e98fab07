"""Opening a bench: drivers, roles, locks of addresses."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar, cast

from pydantic import BaseModel

from drivers.clock import Clock
from drivers.errors import BadReply, DriverError, NoReply, Unreachable, WrongAddress
from drivers.roles import (
    ByHand,
    Chamber,
    Head,
    Identity,
    Instrument,
    PressureController,
    Reader,
    Source,
    WithUnits,
    plays,
)
from fitter.errors import FitError
from rig.baths import Bath
from rig.config import BenchConfig, validated
from rig.contract_files import with_contracts
from rig.errors import BenchFault, ConfigurationError
from rig.guarded import guarded
from rig.person import Person
from rig.plugins import driver_class
from rig.protection import STATES
from rig.quantities import HEAD, PER, PRESSURE, TEMPERATURE_UNIT, VOLT, per_volt, scale

if TYPE_CHECKING:
    from drivers.driver import DriverClass
    from drivers.wires import Wires

Role = TypeVar("Role")

_OTHERWISE = 4
_ASK_AGAIN_S = (1.0, 3.0)


def check_options(config: BenchConfig, where: str, *, strict: bool = True) -> dict[str, BaseModel]:
    """Options of every instrument, checked by its driver, by name. Raises `ConfigurationError`."""
    checked: dict[str, BaseModel] = {}
    taken: dict[str, str] = {}
    for name, instrument in config.instruments.items():
        try:
            cls = driver_class(instrument.driver)
        except ConfigurationError as error:
            raise ConfigurationError(f"{where}: instruments.{name}: {error}") from None
        options = with_contracts(instrument.driver, instrument.options)
        if cls.wire == "none":
            if instrument.address:
                raise ConfigurationError(f"{where}: instruments.{name}.address: a {instrument.driver} has no address")
        elif not instrument.address:
            raise ConfigurationError(f"{where}: instruments.{name}.address is missing: where is it connected?")
        elif strict and cls.wire == "serial" and instrument.address in taken:
            both = f"instruments.{taken[instrument.address]} and instruments.{name}"
            raise ConfigurationError(f"{where}: {both} have one address, {instrument.address}: each needs its own")
        elif strict:  # otherwise the wires refuse it when they are opened: measured data can still be read
            _check_address(instrument.address, cls, f"{where}: instruments.{name}", simulated=config.simulated)
        taken[instrument.address] = name
        checked[name] = validated(cls.Options, options, f"{where}: instruments.{name}", strict=strict)
        if strict and instrument.address:
            _check_wire(instrument.address, checked[name], f"{where}: instruments.{name}")
    _check_limit_names(config, where)
    _check_rates(config, checked, where)
    _check_interlocks(config, where)
    _check_references(config, where)
    _check_safe_setpoints(config, checked, where)
    return checked


def _check_address(address: str, cls: DriverClass, where: str, *, simulated: bool) -> None:
    """Refuse an address that no wire would open, with the wires' own parser."""
    from drivers.wires.addresses import parse_address  # noqa: PLC0415 - imports the wires, which few commands need

    try:
        found = parse_address(address, None if cls.wire == "none" else cls.wire)
    except WrongAddress as error:
        raise ConfigurationError(f"{where}.address: {error}") from None
    if found.simulated and not simulated:
        raise ConfigurationError(
            f"{where}.address: {address} belongs to a twin; write the instrument's own address and use --dry"
        )


def _check_wire(address: str, options: BaseModel, where: str) -> None:
    """Refuse options of the wire that the address cannot have, before anything is opened."""
    from drivers.wires.addresses import text_address  # noqa: PLC0415 - imports the wires, which few commands need
    from drivers.wires.serial_options import SerialOptions, flow_refused  # noqa: PLC0415

    if isinstance(options, SerialOptions):
        place = text_address(address)
        if refused := flow_refused(options.flow_at(address), place):
            raise ConfigurationError(f"{where}.flow: {refused}")
        meaningless = {"baud", "frame"} & options.model_fields_set if place.messages else set()
        if place.messages and "interface" in options.model_fields_set and getattr(options, "interface", "") == "rs232":
            meaningless.add("interface")
        for option in sorted(meaningless):
            raise ConfigurationError(
                f"{where}.{option} is of a serial line, and {address} is none; leave it out, or write a serial address"
            )


def playing(config: BenchConfig, role: type[Any]) -> list[str]:
    """Names of the instruments whose drivers have a role."""
    return [n for n, i in config.instruments.items() if issubclass(cast(type, driver_class(i.driver)), role)]


def _quantities(config: BenchConfig) -> list[str]:
    """Readbacks of a bench, by name, with units."""
    own = [*(HEAD if playing(config, Head) else ()), *([PRESSURE] if playing(config, PressureController) else [])]
    return [*own, *(name for name in config.factors if name not in own)]


def _refuse_unknown(name: str, known: Sequence[str], message: str) -> None:
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        there = (
            f"on this bench there are {', '.join(dict.fromkeys(known))}"
            if known
            else "nothing on this bench has limits"
        )
        there += f'; what sets a factor is said under [factors], {name} = "INSTRUMENT"' if "_" in name else ""
        hint = f"did you mean {near[0]}?" if near else there
        raise ConfigurationError(f"{message}: {hint}")


def _check_limit_names(config: BenchConfig, where: str) -> None:
    """Refuse limits of unknown names: they would protect nothing."""
    chambers = playing(config, Chamber)
    rates = ["pressure_psi_per_s"] if playing(config, PressureController) else []
    known = [*_quantities(config), *(f"{name}_degC" for name in chambers), *rates]
    known += [f"{name}_degC_per_min" for name in chambers]
    for name in config.limits:
        _refuse_unknown(name, known, f"{where}: limits.{name} limits nothing")


_RATES = {"slew_psi_per_s": "pressure_psi_per_s", "vent_psi_per_s": "pressure_psi_per_s"}
"""Driver options for rates, and the limit that applies to each."""


def _check_rates(config: BenchConfig, options: Mapping[str, BaseModel], where: str) -> None:
    """Refuse a rate of a driver option outside the bench's limits."""
    for name, given in options.items():
        rates = {**_RATES, "ramp_degC_per_min": f"{name}_degC_per_min"}
        for option, limit in rates.items():
            rate = getattr(given, option, None)
            if rate is None or limit not in config.limits:
                continue
            low, high = config.limits[limit]
            if rate > min(abs(low), high):
                raise ConfigurationError(
                    f"{where}: instruments.{name}.{option} = {rate:g} is faster than limits.{limit} allows "
                    f"({low:g} to {high:g})"
                )


def _check_interlocks(config: BenchConfig, where: str) -> None:
    """Refuse an interlock on a quantity that is never read: it would protect nothing."""
    chambers = playing(config, Chamber)
    known = [*(f"{name}.{state}" for name in chambers for state in STATES), *_quantities(config), *config.temperatures]
    for name, interlock in config.interlocks.items():
        _refuse_unknown(
            interlock.watch, known, f"{where}: interlocks.{name} watches {interlock.watch}, which is not read"
        )


def _check_references(config: BenchConfig, where: str) -> None:
    """Refuse a formula of a reference standard that cannot be evaluated."""
    for name, reference in config.references.items():
        if reference.formula is not None:
            try:
                of_reading(reference.formula)
            except FitError as error:
                raise ConfigurationError(f"{where}: references.{name}.formula: {error}") from None


def of_reading(formula: str | None) -> Callable[[float], float]:
    """A quantity as a function of a reading; the reading itself without a formula.

    Raises:
        FitError: the formula violates the grammar, or has other variables than `reading`.
    """
    if formula is None:
        return lambda reading: reading
    from fitter.arithmetic_text import parse_expression  # noqa: PLC0415 - few benches have one

    expression = parse_expression(formula)
    if set(expression.names) != {"reading"}:
        odd = sorted({*expression.names} - {"reading"})
        raise FitError(f"its variable is `reading`{f', not {odd[0]}' if odd else ', and it has none'}")
    return lambda reading: float(expression.value({"reading": reading}))


def _check_safe_setpoints(config: BenchConfig, options: Mapping[str, BaseModel], where: str) -> None:
    """Refuse a safe setpoint outside the limits of the safe state: every run would end as unsafe."""
    low, high = config.safety.ambient_degC
    for name, given in options.items():
        safe = getattr(given, "safe_degC", None)
        if safe is not None and not low <= safe <= high:
            raise ConfigurationError(
                f"{where}: instruments.{name}.safe_degC = {safe:g} is outside safety.ambient_degC ({low:g} to {high:g})"
            )


@dataclass
class Bench:
    """The opened instruments by name, with their roles. Their commands are checked (`rig.guarded`).

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
        person: a simulated person; None where real people are asked.
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
        self.scales = {column: self._scale(column, s.unit) for column, s in sensors.items()}
        self.volts = {column: found for column, s in sensors.items() if (found := per_volt(s.unit)) is not None}

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
                    f'with unit = "{unit}" (docs/scpi.md); {reader} can record the output in {own} alone'
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
                raise ConfigurationError(
                    f"bench {self.config.name}: {name}: {reader} has no channel {channel} ({known})"
                )

    @property
    def head(self) -> Head:
        """The dividing head."""
        heads = self._playing(Head)
        if len(heads) != 1:
            raise ConfigurationError(
                f"bench {self.config.name} needs exactly one dividing head for this procedure; it has {len(heads)}"
            )
        return next(iter(heads.values()))

    def by_hand(self, factor: str) -> ByHand | None:
        """The person who sets a factor; None if an instrument does."""
        instrument = self.instruments.get(self.config.factors.get(factor, ""))
        return instrument if isinstance(instrument, ByHand) else None

    def setting(self, factor: str, role: type[Role]) -> tuple[str, Role]:
        """The instrument that sets a factor, and its name. Raises `ConfigurationError` if it cannot."""
        name = self.config.factors.get(factor)
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
