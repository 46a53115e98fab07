"""Checks of a register: against its bench, and against the dates of a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import date

from rig.bench.config import PLACES, BenchConfig, InstrumentConfig, ReferenceConfig, TemperatureConfig
from rig.errors import ConfigurationError
from rig.procedures.column_names import unit_of
from rig.procedures.present.meant import meant
from rig.register.equipment_file import Register
from rig.units.of_instruments import TEMPERATURE_UNIT

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
    places = list(dict.fromkeys((*PLACES, *config.factors, *config.references, *config.temperatures)))
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
                f"the asset number{meant(entry.asset, register.equipment)}"
            )
            continue
        if known.certificate is not None and known.certificate.holds_at and known.stands_in not in places:
            yield (
                f"{where}: equipment.{entry.asset}.stands_in = {known.stands_in!r} is no place of {bench}, which has "
                f"{', '.join(places)}: correct it"
            )
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


def absent(register: Register, config: BenchConfig) -> Iterator[str]:
    """Facts about equipment of a bench that its register does not state, one sentence for each sort."""
    known = {asset: register.equipment[asset] for _, e in entries(config) if (asset := e.asset) in register.equipment}
    dated = {e.asset for _, e in entries(config) if getattr(e, "due", None) is not None}
    dated |= {asset for asset, one in known.items() if one.certificate is None or one.certificate.due is not None}
    undated = [asset for asset in known if asset not in dated]
    nameless = [asset for asset, one in known.items() if not one.serial]
    open_ended = [
        f"{asset} ({', '.join(dict.fromkeys(says.quantity for says in one.says if says.covered is None))})"
        for asset, one in known.items()
        if any(says.covered is None for says in one.says)
    ]
    unconditional = [asset for asset, one in known.items() if one.certificate and one.certificate.holds_at is None]
    if undated:
        yield f"The register states no due date of {', '.join(undated)}: whether a calibration expired is not known."
    if nameless:
        yield f"The register states no serial number of {', '.join(nameless)}: known by the asset number alone."
    if open_ended:
        yield (
            f"The register states no range of {', '.join(open_ended)}: whether the certificate covers the settings is "
            "not known."
        )
    if unconditional:
        yield (
            f"The register states no conditions under which the certificates of {', '.join(unconditional)} hold: "
            "whether the surroundings were permitted is not known."
        )


def unrecorded(config: BenchConfig, room: Collection[str] = ()) -> Iterator[str]:
    """That a bench records no temperature, a sentence.

    Args:
        config: the bench.
        room: what the laboratory states of the room beside the run, by name with unit.
    """
    if not any(unit_of(name) == TEMPERATURE_UNIT for name in (*config.temperatures, *config.references)):
        stated = any(unit_of(name) == TEMPERATURE_UNIT for name in room)
        unknown = "the conditions of the calibration are not known"
        words = "the laboratory states that of the room" if stated else unknown
        yield f"No temperature of the room is recorded with the observations: {words}."


def check_validity(
    register: Register, config: BenchConfig, where: str, first: date, last: date, *, simulated: bool = False
) -> None:
    """Refuse equipment whose certificate was not valid during a run.

    Args:
        register: the register.
        config: the bench; only its equipment is checked.
        where: name of the register's file, for messages.
        first: date of the first observation.
        last: date of the last.
        simulated: whether these are dates of a dry run, which begins on a day that its register covers.

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
            do = "" if simulated else "; have it calibrated, or name the certificate that was valid"
            found.append(f"{key}.due = {certificate.due}, and the run ended on {last}: it had expired{do}")
        if certificate.date > first:
            do = "" if simulated else ": name the one valid then"
            found.append(f"{key}.date = {certificate.date}, and the run began on {first}{do}")
    if found and simulated:
        found.append("the date is simulated: make the dry run again with this register")
    if found:
        raise ConfigurationError("\n".join(found))
