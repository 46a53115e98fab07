"""Checks of a register: against its bench, and against the dates of a run."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date

from rig.config import BenchConfig, InstrumentConfig, ReferenceConfig, TemperatureConfig
from rig.errors import ConfigurationError
from rig.register.schema import Register

Entry = InstrumentConfig | ReferenceConfig | TemperatureConfig


def entries(config: BenchConfig) -> Iterator[tuple[str, Entry]]:
    """Every place of a bench file that may name an asset, with its key."""
    yield from ((f"instruments.{name}", one) for name, one in config.instruments.items())
    yield from ((f"references.{name}", one) for name, one in config.references.items())
    yield from ((f"temperatures.{name}", one) for name, one in config.temperatures.items())


def check_register(register: Register, config: BenchConfig, where: str, bench: str) -> None:
    """Refuse a register that contradicts its bench.

    Args:
        register: the register.
        config: the bench.
        where: name of the register's file, for messages.
        bench: name of the bench file.

    Raises:
        ConfigurationError: with a line for each contradiction.
    """
    found = list(_contradictions(register, config, where, bench))
    if found:
        raise ConfigurationError("\n".join(found))


def _contradictions(register: Register, config: BenchConfig, where: str, bench: str) -> Iterator[str]:
    bearers: dict[tuple[str, str, str], str] = {}
    for asset in dict.fromkeys(entry.asset for _, entry in entries(config) if entry.asset in register.equipment):
        one = register.equipment[asset]
        same = bearers.setdefault((one.maker, one.model, one.serial), asset) if one.serial else asset
        if same != asset:
            yield f"{where}: equipment.{same}.serial and equipment.{asset}.serial are both {one.serial!r}: correct one"
    for key, entry in entries(config):
        if not entry.asset:
            continue
        known = register.equipment.get(entry.asset)
        if known is None:
            yield (
                f"{where}: equipment.{entry.asset} is missing, and {bench} names it ({key}.asset): add it, or correct "
                f"the asset number"
            )
            continue
        serial = getattr(entry, "serial", "")
        if serial and known.serial and serial != known.serial:
            yield (
                f"{where}: equipment.{entry.asset}.serial = {known.serial!r}, and {bench} has {key}.serial = "
                f"{serial!r}: correct the wrong one"
            )
        due, own = getattr(entry, "due", None), known.certificate.due if known.certificate else None
        if due is not None and own is not None and due != own:
            yield (
                f"{where}: equipment.{entry.asset}.certificate.due = {own}, and {bench} has {key}.due = {due}: "
                f"correct the wrong one"
            )


def check_validity(register: Register, config: BenchConfig, where: str, first: date, last: date) -> None:
    """Refuse equipment whose certificate was not valid during a run.

    Args:
        register: the register.
        config: the bench; only its equipment is checked.
        where: name of the register's file, for messages.
        first: date of the first observation.
        last: date of the last.

    Raises:
        ConfigurationError: with a line for each.
    """
    found = []
    for asset in dict.fromkeys(entry.asset for _, entry in entries(config) if entry.asset in register.equipment):
        certificate = register.equipment[asset].certificate
        if certificate is None:
            continue
        key = f"{where}: equipment.{asset}.certificate"
        if certificate.due is not None and certificate.due < last:
            found.append(
                f"{key}.due = {certificate.due}, and the run ended on {last}: it had expired; have it calibrated, or "
                f"name the certificate that was valid"
            )
        if certificate.date > first:
            found.append(f"{key}.date = {certificate.date}, and the run began on {first}: name the one valid then")
    if found:
        raise ConfigurationError("\n".join(found))
