"""A bench file held against its drivers: options, addresses, names of limits and interlocks, formulas of standards."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

from rig.bench.config import BenchConfig, validated
from rig.bench.contract_files import with_contracts
from rig.bench.plugins import driver_class
from rig.bench.protection import STATES
from rig.drivers.errors import WrongAddress
from rig.drivers.roles import Chamber, Head, PressureController, SelfChecking
from rig.errors import ConfigurationError
from rig.fitter.errors import FitError
from rig.procedures.present.meant import nearest
from rig.units.of_instruments import HEAD, PRESSURE

NO_QUESTION = "nothing can be asked that tells whether somebody has changed its settings"
"""Of instruments whose drivers have no such question."""

if TYPE_CHECKING:
    from pydantic import BaseModel

    from rig.drivers.driver import DriverClass


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
        elif strict and instrument.address in taken and not _may_share(cls):
            both = f"instruments.{taken[instrument.address]} and instruments.{name}"
            own = ", or their files say shared = true at [wire]" if hasattr(cls, "shares") else ""
            raise ConfigurationError(f"{where}: {both} have one address, {instrument.address}: each needs its own{own}")
        elif strict:  # otherwise the wires refuse it when they are opened: measured data can still be read
            _check_address(instrument.address, cls, f"{where}: instruments.{name}", simulated=config.simulated)
        taken[instrument.address] = name
        checked[name] = validated(cls.Options, options, f"{where}: instruments.{name}", strict=strict)
        if strict and instrument.address:
            _check_wire(instrument.address, checked[name], f"{where}: instruments.{name}")
    if strict:
        _check_columns(config, where)
    _check_limit_names(config, where)
    _check_rates(config, checked, where)
    _check_interlocks(config, where)
    _check_references(config, where)
    _check_safety(config, checked, where)
    return checked


def _check_columns(config: BenchConfig, where: str) -> None:
    """Refuse a sensor whose column is that of a factor: one would stand in the table in place of the other."""
    others = (
        ("factors", set(config.factors)),
        ("references", set(config.references)),
        ("temperatures", set(config.temperatures)),
    )
    for name, sensor in config.sensors.items():
        column = f"{name}_{sensor.unit}"
        for table, names in others:
            if column in names:
                raise ConfigurationError(
                    f"{where}: sensors.{name} is recorded as {column}, which is {table}.{column}, too: name the sensor "
                    f"otherwise, such as {name}_reading"
                )


def _may_share(cls: DriverClass) -> bool:
    """Whether another instrument may have the same address."""
    return cls.wire not in ("serial", "bridge") or bool(getattr(cls, "shares", False))


def _check_address(address: str, cls: DriverClass, where: str, *, simulated: bool) -> None:
    """Refuse an address that no wire would open, with the wires' own parser."""
    from rig.drivers.wires.addresses import parse_address  # noqa: PLC0415 - imports the wires, which few commands need

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
    from rig.drivers.wires.addresses import text_address  # noqa: PLC0415 - imports the wires, which few commands need
    from rig.drivers.wires.serial_options import SerialOptions, flow_refused  # noqa: PLC0415

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


def unasked(config: BenchConfig) -> list[str]:
    """Names of the instruments that could be asked whether somebody has changed them, and have no question for it."""
    instruments = config.instruments
    return [
        name
        for name in playing(config, SelfChecking)
        if "check" in driver_class(instruments[name].driver).Options.model_fields
        and not instruments[name].options.get("check")
    ]


def cannot_be_asked(config: BenchConfig) -> list[str]:
    """Names of the instruments with a wire whose drivers have no question that tells of a change at the panel."""
    asked = playing(config, SelfChecking)
    return [n for n, i in config.instruments.items() if n not in asked and driver_class(i.driver).wire != "none"]


def _quantities(config: BenchConfig) -> list[str]:
    """Readbacks of a bench, by name, with units."""
    own = [*(HEAD if playing(config, Head) else ()), *([PRESSURE] if playing(config, PressureController) else [])]
    return [*own, *(name for name in config.factors if name not in own)]


def _refuse_unknown(name: str, known: Sequence[str], message: str) -> None:
    if name not in known:
        there = (
            f"on this bench there are {', '.join(dict.fromkeys(known))}"
            if known
            else "nothing on this bench has limits"
        )
        there += f'; what sets a factor is said under [factors], {name} = "INSTRUMENT"' if "_" in name else ""
        near = nearest(name, known)
        hint = f"did you mean {near}?" if near else there
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
    from rig.fitter.arithmetic_text import parse_expression  # noqa: PLC0415 - few benches have one

    expression = parse_expression(formula)
    if set(expression.names) != {"reading"}:
        odd = sorted({*expression.names} - {"reading"})
        raise FitError(f"its variable is `reading`{f', not {odd[0]}' if odd else ', and it has none'}")
    return lambda reading: float(expression.value({"reading": reading}))


def _check_safety(config: BenchConfig, options: Mapping[str, BaseModel], where: str) -> None:
    """Refuse `on_stop` of an instrument that is not on the bench.

    And a safe setpoint outside the limits of the safe state: every run would end as unsafe. And one outside what the
    bench allows its factor: every run would end there.
    """
    named = () if isinstance(config.safety.on_stop, str) else config.safety.on_stop
    for name in named:
        if name not in config.instruments:
            known = ", ".join(config.instruments)
            raise ConfigurationError(f"{where}: safety.on_stop: this bench has no instrument {name} (known: {known})")
    low, high = config.safety.ambient_degC
    for name, given in options.items():
        safe = getattr(given, "safe_degC", None)
        if safe is not None and not low <= safe <= high:
            raise ConfigurationError(
                f"{where}: instruments.{name}.safe_degC = {safe:g} is outside safety.ambient_degC ({low:g} to {high:g})"
            )
    for factor, name in config.factors.items():
        value = getattr(options.get(name), "safe_value", None)
        least, most = config.limits.get(factor, (-math.inf, math.inf))
        if value is not None and not least <= value <= most:
            raise ConfigurationError(
                f"{where}: limits.{factor} = {least:g} to {most:g} does not include the safe_value of {name}, "
                f"{value:g}, where every run ends: widen the limits, and keep levels in the procedure file"
            )
