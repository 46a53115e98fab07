"""What instruments said of themselves in a run, against the register that a certificate prints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rig.bench.config import BenchConfig
from rig.register import Register
from rig.register.equipment_file import Equipment
from rig.register.likeness import unlike
from rig.run_file.events.sessions import Identified


def contradicted(
    register: Register, config: BenchConfig, identities: Iterable[Identified], where: str, *, simulated: bool
) -> Iterator[str]:
    """Instruments that were exchanged in a run, or that are not those of the register: reasons against a certificate.

    Nothing is compared in a simulated run.

    Args:
        register: the equipment.
        config: the bench.
        identities: as recorded, in order.
        where: name of the register, for messages.
        simulated: whether no instrument took part.
    """
    for name, said, asset, known in _pairs(register, config, identities):
        before = said.replaces
        key = f"{where}: equipment.{asset}"
        instead = "correct it, or name the register of the instrument that was used"
        if before is not None:
            yield (
                f"{key} is one instrument, and in the run {name} was exchanged ({before['maker']} {before['model']} "
                f"{before['serial']}, then {said.maker} {said.model} {said.serial}): measure again with one of them"
            )
        elif simulated:
            continue
        elif (key_of := unlike(known, said.model or "", said.serial or "", confirmed=said.confirmed)) == "model":
            yield f"{key}.model = {known.model!r}, and in the run {name} said that it is a {said.model!r}: {instead}"
        elif key_of:
            yield f"{key}.serial = {known.serial!r}, and in the run {name} reported {said.serial!r}: {instead}"


def not_told(register: Register, config: BenchConfig, identities: Iterable[Identified]) -> Iterator[str]:
    """Instruments of which the run does not know that they are those of the register, one sentence each."""
    pairs = list(_pairs(register, config, identities))
    told = {name for name, said, _, known in pairs if said.confirmed and said.serial and known.serial}
    for name, said, asset, known in pairs:
        if name in told or not known.serial:
            continue
        told.add(name)
        what = f"its model ({said.model}), and no serial number" if said.model else "neither model nor serial number"
        yield f"{name} told {what}: that it is {asset}, serial number {known.serial}, is by the register alone."


def _pairs(
    register: Register, config: BenchConfig, identities: Iterable[Identified]
) -> Iterator[tuple[str, Identified, str, Equipment]]:
    """Instruments of the register: name, what it said, asset, entry."""
    for said in identities:
        asset = config.instruments[said.instrument].asset if said.instrument in config.instruments else ""
        known = register.equipment.get(asset)
        if known is not None:
            yield said.instrument, said, asset, known
