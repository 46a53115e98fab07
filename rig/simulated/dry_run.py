"""A dry run: the same bench file, with every address replaced by the driver's twin, under virtual time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

from rig.bench.contract_files import with_contracts
from rig.bench.plugins import driver_class, installed, load, text_of
from rig.contracts.declared.instrument import parse
from rig.drivers.wires import Wires
from rig.drivers.wires.addresses import messages, simulated
from rig.engine.holes import WatchedClock
from rig.errors import ConfigurationError
from rig.sims.bench import SimBench, world_for
from rig.sims.physics import WorldError
from rig.simulated.person import SimulatedPerson
from rig.simulated.stand_ins import with_stand_ins

if TYPE_CHECKING:
    from rig.bench.config import BenchConfig
    from rig.sims.twin import MakesTwins

Tap = Callable[[str, str, bytes], None]
"""Called with (instrument, "tx" or "rx", bytes) for every transfer on every wire."""

_keys = itertools.count(1)


@cache
def twin_class(driver: str) -> MakesTwins:
    """The twin registered for a driver, entry-point group `rig.twins`; of a file without one, that of the file.

    Raises:
        ConfigurationError: it has none.
    """
    known = installed("rig.twins")
    if driver not in known and (text := text_of(driver)):
        from rig.sims.declared import twin_of  # noqa: PLC0415 - few benches have one

        return twin_of(text)
    if driver not in known:
        raise ConfigurationError(f"driver {driver!r} has no twin, so it cannot run dry (twins: {', '.join(known)})")
    found: MakesTwins = load("rig.twins", driver, ("wire", "roles", "faults"))
    return found


def twin_classes(config: BenchConfig) -> dict[str, MakesTwins]:
    """The twins of a bench, by driver name. Raises `ConfigurationError` with the name of an instrument that has
    none.
    """
    found = {}
    for name, instrument in config.instruments.items():
        try:
            found[instrument.driver] = twin_class(instrument.driver)
            if text := text_of(instrument.driver):
                _ = parse(text).hooks  # before the twin runs it
        except (ConfigurationError, ValueError) as error:
            raise ConfigurationError(f"instruments.{name}: {error}") from None
    return found


def plain(config: BenchConfig) -> dict[str, Any]:
    """A bench file as plain values for the simulation, with its contracts."""
    values = config.model_dump(mode="json", exclude_none=True)
    for name, instrument in config.instruments.items():
        values["instruments"][name] |= with_contracts(instrument.driver, instrument.options)
        if messages(instrument.address) and "interface" in driver_class(instrument.driver).Options.model_fields:
            values["instruments"][name].setdefault("interface", "gpib")  # the twin has no serial line then
    return values


class DryBench:
    """A simulated bench in this process.

    Args:
        config: the bench file as given.
        truth: the world file's values; {} for the default world.
        start: virtual seconds at which its time begins.
        where: the world file's name, for messages.
        tap: called for every transfer on every wire.
        key: part of its addresses, unique in this process; "" to generate one.
        record_tape: keep the true events in `sim.tape`, for checkers.

    Raises:
        ConfigurationError: the world file is wrong, or a driver that is neither reader nor source has no twin.

    """

    def __init__(
        self,
        config: BenchConfig,
        truth: Mapping[str, Any],
        *,
        start: float = 0.0,
        where: str = "world",
        tap: Tap | None = None,
        record_tape: bool = False,
        key: str = "",
    ) -> None:
        self._where = where
        config = with_stand_ins(config)
        values = plain(config)
        key = key or f"dry{next(_keys)}"
        try:
            self.world = world_for(values, truth, start)
            self.sim = SimBench(self.world, values, truth, key, twin_classes(config), record_tape=record_tape)
        except WorldError as error:
            raise ConfigurationError(f"{where}: {error}") from error
        instruments = {
            name: i.model_copy(update={"address": i.address and simulated(i.address, f"sim://{key}/{name}")})
            for name, i in config.instruments.items()
        }
        self.config = config.model_copy(update={"instruments": instruments, "simulated": True})
        self.clock = WatchedClock(self.world)
        self.person = SimulatedPerson(self.sim)
        self.wires = Wires(self.clock, simulated=self.sim.transports(), tap=tap)

    @contextmanager
    def checked(self) -> Iterator[None]:
        """A context in which a formula of the world file that has no value is an error of that file.

        Raises:
            ConfigurationError: it has none at a setting of the run.
        """
        try:
            yield
        except WorldError as error:
            raise ConfigurationError(f"{self._where}: {error}") from error

    def close(self) -> None:
        """Remove the simulated addresses."""
        self.sim.close()
