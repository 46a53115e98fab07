"""The axes of a bench: what sets each factor, as something that moves."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rig.bench.approach import Approach
from rig.drivers.roles import Chamber, Instrument, PressureController, Source
from rig.engine.axes import Axes, ChamberMover, HeadMover, Mover, PressureMover, SourceMover
from rig.engine.hard_factors import held_factors, of_head
from rig.engine.steered import Steered
from rig.errors import ConfigurationError
from rig.instruments.opening import Bench
from rig.procedures.column_names import stem_of, unit_of
from rig.procedures.plan.run_list import Factor, RunList
from rig.units.of_instruments import PRESSURE_UNIT, TEMPERATURE_UNIT


def axes_of(
    bench: Bench,
    factors: Sequence[Factor],
    band: Callable[[str], float] = lambda _: 0.0,
    near: Callable[[str], float] = lambda _: 0.0,
) -> Axes:
    """The axes of these factors on a bench; factors that a person sets have none.

    Args:
        bench: opened instruments.
        factors: what they move.
        band: how near its setting an axis counts as there.
        near: how near its level the reading of a factor's standard is brought, where it is.

    Raises:
        ConfigurationError: nothing sets a factor, or its instrument cannot.
    """
    movers: list[Mover] = []
    if any(of_head(bench, f) for f in factors):
        movers.append(HeadMover(bench.head))
    movers += [
        _mover(bench, f, band(f.axis), near) for f in factors if not of_head(bench, f) and bench.by_hand(f.name) is None
    ]
    return Axes(movers)


def _mover(bench: Bench, factor: Factor, band: float, near: Callable[[str], float]) -> Mover:
    """What sets a factor, as an axis. Raises `ConfigurationError` if it cannot."""
    name, instrument = bench.setting(factor.name, Instrument)
    of = bench.config.steered.get(factor.name)
    if of is not None:
        own, pairs = Factor(of, stem_of(of)), bench.config.references[factor.name].approach or ()
        return Steered(_mover(bench, own, band, near), own, factor, Approach.of(pairs), near(factor.name))
    if isinstance(instrument, PressureController):
        mover: Mover = PressureMover(instrument, factor)
        unit = PRESSURE_UNIT
    elif isinstance(instrument, Chamber):
        mover, unit = ChamberMover(instrument, factor), TEMPERATURE_UNIT
    elif isinstance(instrument, Source):
        mover, unit = SourceMover(instrument, factor, band), instrument.unit()
    else:
        raise ConfigurationError(
            f"bench {bench.config.name}: {name} cannot set {factor.name}: it is neither a source nor a pressure "
            f"controller, a chamber or a person"
        )
    if unit != unit_of(factor.name):
        raise ConfigurationError(
            f"bench {bench.config.name}: {name} sets {unit}, not {unit_of(factor.name)}: call the factor "
            f"{factor.axis}_{unit}, with levels in {unit}"
        )
    return mover


def own_limits(bench: Bench, run_list: RunList) -> dict[str, tuple[float, float]]:
    """The instruments' own (low, high) by factor name."""
    moved = (*run_list.easy, *held_factors(bench, run_list))
    span = axes_of(bench, moved).span()
    found = {f.name: span[f.axis] for f in moved if f.axis in span}
    soaked = (f for f in run_list.hard if f.name not in found and bench.by_hand(f.name) is None)
    return found | {f.name: bench.soaks(f.name)[1].limits() for f in soaked}
