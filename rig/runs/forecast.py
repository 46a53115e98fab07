"""Forecast of the end of a run, with its uncertainty, by a rehearsal.

The first points of the run list are run dry, on twins with the bench file's own speeds and settings. They are looked at
less often than in a run while something is far from settled. The rest is extrapolated. A rehearsal does not show
repeats, retries and interruptions; a stated allowance covers them.
"""

from __future__ import annotations

import contextlib
import itertools
import statistics
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.bench.bench_file import playing
from rig.bench.config import FOLLOWS_S, BenchConfig
from rig.bench.plugins import driver_class
from rig.bench.typed import typed_columns
from rig.drivers.roles import ByHand, Chamber, Source
from rig.engine.pace import Pace, follows_s
from rig.engine.session import Outcome, Progress, Signals
from rig.errors import RigError
from rig.procedures.column_names import unit_of
from rig.procedures.plan.hand_steps import ALLOWANCE_H, HandStep
from rig.procedures.plan.run_list import RunList
from rig.run_file.events.points import Observed, WholePlotBegan
from rig.run_file.read.reader import RunReader
from rig.run_file.write.unsynced import unsynced
from rig.runs.controller import Result, Site, opened, start_run
from rig.units.of_instruments import TEMPERATURE_UNIT

if TYPE_CHECKING:
    from rig.drivers.clock import Clock
    from rig.instruments.opening import Bench
    from rig.runs.plans import Plan

ALLOWANCE = 0.05
"""Relative allowance for repeats, retries and one short interruption."""

_CHAMBERS = ("sensor", "sse")
"""Simulated chambers; that of any other laboratory is the first."""

REHEARSED, REHEARSED_WITH_SOAKS = 100, 60
"""Points of a rehearsal unless said otherwise: a point of a run with soaks costs ten times as many polls. In the
example laboratories the forecast is within 0.2 % of that from 400 points.
"""

SOAK_ALLOWANCE = 0.2
"""Relative allowance for soaks: settling of a loaded chamber differs between benches, and a rehearsal has typical
values.
"""


@dataclass(frozen=True)
class Forecast:
    """Expected duration of a run, in bench seconds.

    Attributes:
        preparation_s: time before the first point: set-up, homing, environment, the first soak.
        point_s: mean of one point: move, settle, measure.
        point_sd_s: its standard deviation between points.
        soak_s: mean of the soaks between whole plots; None if there are none.
        total_s: duration of the whole run without incidents.
        latest_s: duration with the allowances.
        rehearsed: number of rehearsed points.
        by_hand_s: of these durations, what is allowed for steps by hand, which are not rehearsed.
        assumed: undeclared assumptions, one sentence each.
    """

    preparation_s: float
    point_s: float
    point_sd_s: float
    soak_s: float | None
    total_s: float
    latest_s: float
    rehearsed: int
    assumed: tuple[str, ...] = ()
    by_hand_s: float = 0.0

    def when_s(self, step: HandStep, run_list: RunList) -> float:
        """Expected time of a step by hand without incidents, seconds after the begin: before its point is prepared."""
        earlier = 3600.0 * ALLOWANCE_H * run_list.steps.index(step)
        if not step.before:
            return earlier
        soaks = (run_list.points[step.before - 1].whole_plot or 1) - 1
        return earlier + self.preparation_s + step.before * self.point_s + soaks * (self.soak_s or 0.0)


def _ordinary(plan: Plan) -> dict[str, Any]:
    """The world of a rehearsal: default values; sensors follow their chambers, and baths their settings, as in the
    bench file.
    """
    bench, sources = plan.bench, playing(plan.bench, Source)
    said = {name: follows_s(bench, name) for name in bench.factors if _follows(bench, name)}
    baths = {name: {"time_constant_s": s} for name, s in said.items() if bench.factors[name] in sources}
    chambers = {
        f"{stem if (stem := name.removesuffix('_temperature_degC')) in _CHAMBERS else _CHAMBERS[0]}_chamber": {
            "body_time_constant_s": seconds
        }
        for name, seconds in said.items()
        if name not in baths
    }
    return chambers | ({"sources": baths} if baths else {})


def _follows(bench: BenchConfig, factor: str) -> bool:
    """Whether the bench file says how fast a thermometer of a factor follows."""
    return any(bench.temperatures[name].follows_s is not None for name in bench.thermometers(factor))


def _assumed(plan: Plan) -> Iterator[str]:
    """Assumptions about soaks if the bench file has no values, and about people."""
    yield from _people(plan)
    bench, sources, chambers = plan.bench, playing(plan.bench, Source), playing(plan.bench, Chamber)
    for factor in plan.run_list.factors:
        name, setter = factor.name, bench.factors.get(factor.name, "")
        thermometers = bench.thermometers(name)
        follows = _follows(bench, name)
        if setter in sources and unit_of(name) == TEMPERATURE_UNIT:
            driver = driver_class(bench.instruments[setter].driver)
            told = {**getattr(driver, "supplied", {}), **bench.instruments[setter].options}
            if "time_constant_s" not in told and not follows:
                known = "time_constant_s" in driver.Options.model_fields
                better = f"; instruments.{setter}.time_constant_s in the bench file says better" if known else ""
                yield f"assumed: {setter} approaches its setting with a time constant of {FOLLOWS_S:g} s{better}"
        elif factor.hard and unit_of(name) == TEMPERATURE_UNIT and setter in chambers and not follows:
            key = f"temperatures.{thermometers[0] if thermometers else 'NAME'}.follows_s"
            which = "" if thermometers else f', of a thermometer with place = "{name}",'
            yield (
                f"assumed: what is in the chamber of {name} follows it with {FOLLOWS_S:g} s; {key}{which} in the bench "
                "file says better"
            )


def _people(plan: Plan) -> Iterator[str]:
    """The assumption about a person who sets or reads: nobody promises when a run with them ends."""
    bench = plan.bench
    hands = playing(bench, ByHand)
    sets = [factor.name for factor in plan.run_list.factors if bench.factors.get(factor.name) in hands]
    reads = [*typed_columns(bench, plan.procedure.conduct)]
    does = [f"{verb} {', '.join(names)}" for verb, names in (("sets", sets), ("reads", reads)) if names]
    if does:
        yield (
            f"assumed: a person is at the bench for the whole run, and {' and '.join(does)} as quickly as in the "
            "rehearsal; the run waits as long as they take, and ends later then"
        )


def _skipped(result: Result) -> Iterator[str]:
    """Rehearsed points that could not be measured, with the first reason."""
    skipped, points = result.state.skipped, result.state.points
    if skipped:
        first = skipped[min(skipped)]
        yield f"{len(skipped)} of {points} rehearsed points could not be measured on simulated instruments: {first}"


def _at_rest(result: Result) -> str:
    """What to look at if limits were left before the first point; "" otherwise."""
    if len(result.state.accepted) or ", outside " not in result.message:
        return ""
    return (
        "\nnothing had been set yet: the limits have to include the value at rest, before the first setting; "
        "that of a twin is `rest` in [sources.FACTOR] of the world file"
    )


@contextlib.contextmanager
def _for_forecast(plan: Plan, *, start: float = 0.0) -> Iterator[tuple[Bench, Clock, str]]:
    """The bench of a rehearsal: see `rig.instruments.opening.Bench.forecast`."""
    with opened(plan, start=start) as (bench, clock, boot):
        bench.forecast = True
        yield bench, clock, boot


def rehearse(plan: Plan, on_progress: Callable[[Progress], None], *, points: int | None = None) -> Forecast:
    """Run the first `points` points dry and extrapolate.

    Args:
        plan: what is rehearsed.
        on_progress: called as in a run.
        points: how many; by default as many as the kind of run needs, see `REHEARSED`.

    Raises:
        RigError: the rehearsal failed, or measured no point; the run itself would, too.
    """

    def rehearsing(news: Progress) -> None:
        on_progress(news._replace(state="rehearsing", message="", detail=""))  # it asks nobody for anything

    soaks_between = plan.procedure.conduct.whole_plots is not None
    wanted = points or (REHEARSED_WITH_SOAKS if soaks_between else REHEARSED)
    head = RunList(plan.run_list.factors, plan.run_list.points[:wanted], plan.run_list.seed)
    pace = None
    if soaks_between:
        pace = Pace(plan.run_list, plan.procedure.conduct, plan.bench)
    with tempfile.TemporaryDirectory(prefix="rig-rehearsal-") as folder, unsynced() as vfs:
        paths: list[Path] = []
        dry = replace(plan, run_list=head, dry=True, truth=_ordinary(plan))
        site = Site(_for_forecast, vfs)  # nobody keeps this run file
        result = start_run(
            dry, Path(folder), signals=Signals(), announce=paths.append, on_progress=rehearsing, site=site
        )
        if result.outcome is not Outcome.COMPLETE:
            raise RigError(f"a rehearsal on simulated instruments failed: {result.message}{_at_rest(result)}")
        with RunReader.open(paths[0]) as reader:
            seen = [(r.elapsed_s, r.whole_plot) for r in reader.records(Observed.kind) if r.accepted]
            soaked = {
                r.whole_plot: r.elapsed_s
                for r in reader.records(WholePlotBegan.kind)
                if isinstance(r.event, WholePlotBegan)
            }
            if pace is not None:
                for record in reader.records():
                    pace.add(record)
    if not seen:
        raise RigError("; ".join([*_skipped(result), *_assumed(plan)]))
    pairs = list(itertools.pairwise(seen))
    steps = [b - a for (a, before), (b, now) in pairs if now == before] or [0.0]
    soaks = [soaked[now] - a for (a, before), (_, now) in pairs if now != before]
    point = statistics.fmean(steps)
    soak = statistics.fmean(soaks) if soaks else None
    preparation = max(0.0, seen[0][0] - point)
    soaking = max(0, plan.run_list.whole_plots - 1) * (soak or 0.0)
    if pace is None:
        total = preparation + len(plan.run_list) * point + soaking
    else:
        total = seen[-1][0] + pace.remaining_s(seen[-1][0])
    measuring = total - preparation - soaking
    by_hand = 3600.0 * ALLOWANCE_H * len(plan.run_list.steps)
    first = 1 + SOAK_ALLOWANCE if soaks else 1.0
    return Forecast(
        preparation_s=preparation,
        point_s=point,
        point_sd_s=statistics.pstdev(steps),
        soak_s=soak,
        total_s=total + by_hand,
        latest_s=by_hand + preparation * first + measuring * (1 + ALLOWANCE) + soaking * (1 + SOAK_ALLOWANCE),
        rehearsed=len(seen),
        assumed=(*_assumed(plan), *_skipped(result)),
        by_hand_s=by_hand,
    )
