"""The day on which a simulated night begins, if its world file does not say it: one that the register covers."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, date, datetime, timedelta
from typing import TYPE_CHECKING, Any

from rig.register import DOCUMENT, entries, parse_register
from rig.sims.bench import world_for
from rig.sims.world import EPOCH_UTC
from rig.simulated.dry_run import plain

if TYPE_CHECKING:
    from rig.bench.config import BenchConfig


def begins(truth: Mapping[str, Any], config: BenchConfig, register: str | None) -> datetime:
    """Bench time at which a dry run begins; arguments as those of `dated`. Raises `rig.sims.physics.WorldError`."""
    return datetime.fromtimestamp(world_for(plain(config), dated(truth, config, register)).utc(), UTC)


def why(truth: Mapping[str, Any], config: BenchConfig, register: str | None) -> str:
    """The simulated date of a dry run, and the reason for it; "" without a register, or if the world states the date.

    Arguments as those of `dated`. Raises `rig.sims.physics.WorldError`.
    """
    if register is None or "epoch" in truth:
        return ""
    known = any(one.certificate is not None for one in parse_register(register, DOCUMENT).equipment.values())
    valid = "a day on which the certificates of the register are valid"
    usual = f"the usual date of dry runs, as {DOCUMENT} states no date of a certificate"
    return f"{begins(truth, config, register).date()}: {valid if known else usual}"


def dated(truth: Mapping[str, Any], config: BenchConfig, register: str | None) -> Mapping[str, Any]:
    """A world with an epoch: its own, or the usual one moved to a day on which all certificates of a bench are valid.

    Args:
        truth: the world file's values.
        config: the bench.
        register: text of its register; None if it has none. Where no day is covered the usual epoch stays.
    """
    if register is None or "epoch" in truth:
        return truth
    known = parse_register(register, DOCUMENT)
    assets = {entry.asset for _, entry in entries(config)} & known.equipment.keys()
    every = [one for asset in assets if (one := known.equipment[asset].certificate) is not None]
    items = (known.sensors.get(key) for name, one in config.sensors.items() for key in (name, one.asset))
    received = [one.received for one in items if one is not None and one.received is not None]
    usual = datetime.fromtimestamp(EPOCH_UTC, UTC)
    first = max([*(one.date for one in every), *received], default=usual.date())
    last = min((one.due for one in every if one.due is not None), default=date.max)
    if first <= usual.date() < last or first >= last:
        return truth
    return {**truth, "epoch": usual + timedelta(days=(first - usual.date()).days)}
