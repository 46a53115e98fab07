"""What on a simulated bench is not safe at this moment, whatever its instruments say."""

from __future__ import annotations

from collections.abc import Iterator

from rig.simulated.dry_run import DryBench


def not_safe(bench: DryBench, *, moving_only: bool) -> Iterator[str]:
    """What is not safe now, in words.

    Args:
        bench: the simulated bench.
        moving_only: an interrupted session leaves pressure and temperatures as they are, for the next one.

    """
    now, plant, config = bench.world.now(), bench.sim.plant, bench.config
    line = plant.stand.line(config.factors["pressure_psia"]) if "pressure_psia" in config.factors else None
    if line is None:
        yield from (f"{axis} is moving" for axis in plant.head.axes if plant.head.moving(axis, now))
    if moving_only:
        return
    if line is not None:
        psia = line.pressure_psia(now)
        if line.controlling or abs(psia - line.ambient_psia(now)) > _AT_THE_ATMOSPHERE_PSI:
            yield f"the line is at {psia:.2f} psia, {'controlled' if line.controlling else 'closed'}"
    for name in config.instruments:
        roles = bench.sim.twin(name).roles
        if "source" in roles and plant.source(name).on and not _at_rest(bench, name):
            yield f"{name} is left on at {plant.source(name).setpoint:g}"
        if "chamber" in roles:
            setpoint = plant.chamber(name).setpoint_degC
            if not _HARMLESS_DEGC[0] <= setpoint <= _HARMLESS_DEGC[1]:
                yield f"{name} is left at a setpoint of {setpoint:.1f} degC"


def _at_rest(bench: DryBench, name: str) -> bool:
    """Whether a source without a switch, which is always on, is at its safe value."""
    table = getattr(bench.sim.twin(name), "table", None)
    source = table.source if table is not None else None
    if source is None or source.off or source.safe_value is None:
        return False
    return bool(abs(bench.sim.plant.source(name).setpoint - source.safe_value) <= source.nearness)


_AT_THE_ATMOSPHERE_PSI = 0.5
_HARMLESS_DEGC = (15.0, 30.0)
