"""A bench file brought to life: drivers opened, roles found, addresses locked."""

from __future__ import annotations

import contextlib
import difflib
import fcntl
import hashlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

from pydantic import BaseModel

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.roles import Chamber, Head, Instrument, PressureController, Reader
from rig.config import BenchConfig, InstrumentConfig, validated
from rig.contracts import with_contracts
from rig.errors import BenchFault, BusyError, ConfigurationError

if TYPE_CHECKING:
    from drivers.wires import Wires

Role = TypeVar("Role")

_PER_VOLT = {"V": 1.0, "mV": 1e3}


class DriverClass(Protocol):
    """What an entry point of group `rig.drivers` names."""

    Options: type[BaseModel]

    def __call__(self, name: str, address: str, options: BaseModel, wires: Wires, clock: Clock) -> Instrument:
        """Open the instrument's wire; sends nothing."""
        ...


@cache
def driver_class(name: str) -> DriverClass:
    """The driver registered under `name`; raises `ConfigurationError` listing the known ones."""
    known = {point.name: point for point in entry_points(group="rig.drivers")}
    if name not in known:
        raise ConfigurationError(f"driver {name!r} is not known; installed: {', '.join(sorted(known))}")
    found: DriverClass = known[name].load()
    return found


def check_options(config: BenchConfig, where: str) -> dict[str, BaseModel]:
    """Every instrument's options checked by its driver, by name; raises `ConfigurationError`."""
    checked = {}
    for name, instrument in config.instruments.items():
        try:
            cls = driver_class(instrument.driver)
        except ConfigurationError as error:
            raise ConfigurationError(f"{where}: instruments.{name}: {error}") from None
        options = with_contracts(instrument.driver, instrument.options)
        checked[name] = validated(cls.Options, options, f"{where}: instruments.{name}")
    _check_limit_names(config, where)
    return checked


def playing(config: BenchConfig, role: type[Any]) -> list[str]:
    """Names of the instruments whose drivers play a role."""
    return [n for n, i in config.instruments.items() if issubclass(cast(type, driver_class(i.driver)), role)]


def _check_limit_names(config: BenchConfig, where: str) -> None:
    """A limit nobody knows would protect nothing."""
    axes = ["pitch_deg", "roll_deg"] if playing(config, Head) else []
    pressures = ["pressure_psia"] if playing(config, PressureController) else []
    known = [*axes, *pressures, *(f"{name}_degC" for name in playing(config, Chamber))]
    for name in config.limits:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"on this bench there are {', '.join(known)}"
            raise ConfigurationError(f"{where}: limits.{name} limits nothing: {hint}")


@dataclass
class Bench:
    """Opened instruments by name, and which of them plays which role.

    Attributes:
        config: the bench file.
        instruments: drivers by the bench's names for them.
        sensors: output column to (instrument, channel).
        scales: output column to its unit per volt.
        temperatures: temperature column to (instrument, channel).

    """

    config: BenchConfig
    instruments: dict[str, Instrument]
    clock: Clock
    wires: Wires
    sensors: Mapping[str, tuple[str, str]] = field(init=False)
    scales: Mapping[str, float] = field(init=False)
    temperatures: Mapping[str, tuple[str, str]] = field(init=False)

    def __post_init__(self) -> None:
        sensors = {f"{name}_{s.unit}": s for name, s in self.config.sensors.items()}
        self.sensors = {column: (s.reader, s.channel) for column, s in sensors.items()}
        self.scales = {column: _PER_VOLT[s.unit] for column, s in sensors.items()}
        self.temperatures = {name: (t.reader, t.channel) for name, t in self.config.temperatures.items()}
        self._check_channels()

    def _check_channels(self) -> None:
        for name, (reader, channel) in (*self.sensors.items(), *self.temperatures.items()):
            instrument = self.instruments[reader]
            if not isinstance(instrument, Reader):
                raise ConfigurationError(
                    f"bench {self.config.name}: {name} is to be read by {reader}, which reads nothing"
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

    def setting(self, factor: str, role: type[Role]) -> tuple[str, Role]:
        """The instrument that sets a factor, and its name; raises `ConfigurationError` if it cannot."""
        name = self.config.factors.get(factor)
        if name is None:
            raise ConfigurationError(
                f"bench {self.config.name} does not say what sets {factor}: add it under [factors], "
                f'{factor} = "INSTRUMENT"'
            )
        instrument = self.instruments[name]
        if not isinstance(instrument, role):
            raise ConfigurationError(f"bench {self.config.name}: {name} cannot set {factor}: it is no {role.__name__}")
        return name, instrument

    @property
    def chambers(self) -> dict[str, Chamber]:
        """Chambers and enclosures by name."""
        return self._playing(Chamber)

    @property
    def readers(self) -> dict[str, Reader]:
        """The instruments that read sensors or temperatures, by name."""
        used = {reader for reader, _ in (*self.sensors.values(), *self.temperatures.values())}
        return {name: r for name, r in self._playing(Reader).items() if name in used}

    def _playing(self, role: type[Role]) -> dict[str, Role]:
        return {name: i for name, i in self.instruments.items() if isinstance(i, role)}

    def make_safe(self) -> list[str]:
        """Bring every instrument to its safe state, going on past errors; returns what could not be done."""
        failed = []
        for name, instrument in self.instruments.items():
            try:
                instrument.make_safe()
            except (DriverError, OSError) as error:
                failed.append(f"{name}: {error}")
        return failed

    def close(self) -> None:
        """Release every wire."""
        for instrument in self.instruments.values():
            with contextlib.suppress(DriverError, OSError):
                instrument.close()
        self.wires.close()


def open_bench(config: BenchConfig, options: Mapping[str, BaseModel], clock: Clock, wires: Wires) -> Bench:
    """Open every instrument's wire. Sends nothing. Raises `BenchFault` naming the instrument that fails."""
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


@contextlib.contextmanager
def locked_addresses(instruments: Mapping[str, InstrumentConfig]) -> Iterator[None]:
    """Hold a lock for every address of a bench; raises `BusyError` if another controller has one.

    The locks are files named after the address in a folder all users of the machine share, since the address
    itself may be a host and port, and a lock taken on a device file would not be seen by network users of it.
    """
    folder = Path(tempfile.gettempdir()) / "calibration-rig-locks"
    folder.mkdir(mode=0o1777, exist_ok=True)
    with contextlib.suppress(PermissionError):  # made by another user, who has already opened it to all
        folder.chmod(0o1777)
    held: list[int] = []
    try:
        for address in sorted({_wire_of(i.address) for i in instruments.values()}):
            descriptor = _lock(folder / hashlib.sha256(address.encode()).hexdigest()[:32], address)
            held.append(descriptor)
        yield
    finally:
        for descriptor in held:
            os.close(descriptor)


def _wire_of(address: str) -> str:
    """What is locked: two units on one Modbus line are one wire; a device is known by its real path."""
    if address.startswith(("modbus-tcp://", "modbus-rtu://")):
        address = address.rpartition("/")[0]
    return os.path.realpath(address) if address.startswith("/") else address


def _lock(path: Path, address: str) -> int:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    with contextlib.suppress(PermissionError):
        os.fchmod(descriptor, 0o666)  # the creating user's umask must not shut others out
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise BusyError(f"{address} is in use by another controller of this machine; stop that one first") from None
    return descriptor


def identities(bench: Bench) -> dict[str, dict[str, Any]]:
    """Ask every instrument who it is; what the run file keeps, by name. Raises `DriverError`."""
    found = {}
    for name, instrument in bench.instruments.items():
        declared = bench.config.instruments[name]
        reply = instrument.identify()
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
