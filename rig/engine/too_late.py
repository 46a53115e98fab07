"""Advice where a wait was too short: the limit's key with its value, what else decides, and the next step.

A fault's message says what was read. Only a message with which a run stops has this advice, too.
"""

from __future__ import annotations

from rig.bench.config import BenchConfig
from rig.engine.fault_classes import NotSettled
from rig.engine.states import State
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.conduct import Conduct, EnvironmentSettings, SoakSettings
from rig.procedures.plan.run_list import Factor, RunList
from rig.units.of_instruments import TEMPERATURE_UNIT

LEAST_MOVE_S = 600.0
"""A move may take as long as settling, and this long at least: chosen; a whole turn takes a minute."""


def advice(
    error: Exception, state: State, conduct: Conduct, run_list: RunList, bench: BenchConfig, *, simulated: bool
) -> str:
    """What to change where a wait ended the run: sentences that begin with a line's end; "" for any other error.

    Args:
        error: why the run stops.
        state: of the sequencer, when it was raised.
        conduct: limits of the procedure.
        run_list: its factors.
        bench: its instruments.
        simulated: whether the instruments are twins.
    """
    if not isinstance(error, NotSettled) or not error.too_late:
        return ""
    late = [f for f in run_list.factors if f.axis in error.too_late]
    if state is State.PREPARING and not (held := [f for f in late if f.hard and not _of_temperature(f)]):
        told, late = _prepared(conduct), [f for f in run_list.hard if _of_temperature(f)]
    elif state is State.PREPARING:
        told, late = _moved(conduct, held, bench, least_s=0.0), held
    else:
        told = _moved(conduct, late, bench, least_s=LEAST_MOVE_S if state is State.MOVING else 0.0)
    told += _twin(late, bench) if simulated else []
    if any(_of_temperature(f) and not f.hard for f in late):
        told.append("A temperature that takes so long is better a whole plot: `hard = true` of its factor, and [soak].")
    return "\n" + " ".join(told)


def _of_temperature(factor: Factor) -> bool:
    return unit_of(factor.name) == TEMPERATURE_UNIT


def _prepared(conduct: Conduct) -> list[str]:
    """Limits before a whole plot, or before the first point."""
    more = ""
    if conduct.whole_plots is not None:
        asked: SoakSettings | EnvironmentSettings = conduct.whole_plots.soak
        table, more = "soak", f"sensor_tolerance_degC (now {conduct.whole_plots.soak.sensor_tolerance_degC:g}), "
    elif conduct.environment is not None:
        asked, table = conduct.environment, "environment"
    else:
        return []
    return [
        f"Next: raise timeout_s of [{table}] in the procedure (now {asked.timeout_s:g}); or allow more there: "
        f"tolerance_degC (now {asked.tolerance_degC:g}), {more}drift_degC_per_h (now {asked.drift_degC_per_h:g}), or a "
        f"shorter dwell_s (now {asked.dwell_s:g})."
    ]


def _moved(conduct: Conduct, late: list[Factor], bench: BenchConfig, least_s: float) -> list[str]:
    """Limits of a move and of settling."""
    now = max((conduct.settled(f.axis).timeout_s for f in late), default=conduct.settle.timeout_s)
    least = f", and a move may take {least_s:g} in any case" if now < least_s else ""
    told = [f"Next: raise timeout_s of [settle] in the procedure (now {now:g}{least})."]
    for factor in late:
        settle, unit = conduct.settled(factor.axis), spelled(unit_of(factor.name))
        of = f"[factors.{factor.name}]" if conduct.any_instruments else "[settle]"
        told.append(
            f"Or allow more: a wider band in {of} (now {settle.band:g} {unit}), or a shorter dwell_s of [settle] (now "
            f"{settle.dwell_s:g})."
        )
        name = bench.setters.get(factor.name, "")
        options = bench.instruments[name].options if name in bench.instruments else {}
        if "tolerance" in options:
            told.append(
                f"{name} says that it has arrived within tolerance of [instruments.{name}] in the bench file (now "
                f"{options['tolerance']:g} {unit})."
            )
    return told


def _twin(late: list[Factor], bench: BenchConfig) -> list[str]:
    """How slow a twin is."""
    found = []
    for factor in late:
        if name := bench.setters.get(factor.name, ""):
            own = bench.instruments[name].options.get("time_constant_s")
            now = "left out" if own is None else f"now {own:g}"
            found.append(
                f"The twin is as slow as time_constant_s of [sources.{factor.name}] in the world file says, or of "
                f"[instruments.{name}] in the bench file ({now})."
            )
    return found
