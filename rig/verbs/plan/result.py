"""`rig plan`: forecast of a run."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.bench.bench_file import cannot_be_asked, unasked
from rig.drivers.clock import RealClock, ScaledClock
from rig.errors import ConfigurationError, UsageError
from rig.files.disk_space import needed_bytes
from rig.fitter.errors import FitError
from rig.procedures.kinds import kind_of
from rig.procedures.plan.advice import Advice
from rig.procedures.present.blocks import Block
from rig.procedures.tables.unused import known_unit_of
from rig.register import DOCUMENT
from rig.runs.forecast import rehearse
from rig.runs.plans import Plan as Checked
from rig.runs.plans import load_plan
from rig.verbs.frames import Frame, of_rows
from rig.verbs.plan import for_people
from rig.verbs.plan.dwells import narrow_bands, short_dwells, unread
from rig.verbs.plan.expected import Expected, time_of
from rig.verbs.plan.foreseen import beside, not_stated, stops, surroundings
from rig.verbs.plan.promised import promised
from rig.verbs.plan.unit_doubts import unit_doubts
from rig.verbs.result import Plots, Result

if TYPE_CHECKING:
    from rig.engine.session import Progress


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Expected, Result):
    """Expected duration and precision of a run, and problems.

    Attributes:
        checked: bench, procedure and run list.
        precision: predicted precision.
        advice: recommendations for this kind of procedure, compared with it.
        forecast: expected duration.
        now: assumed time of its start.
        disk: free bytes in the folder of its file, and needed bytes.
        promised: total uncertainties by the bench's register of equipment.

    Example:
        >>> plan = rig.plan("procedure.toml", "bench.toml")
        >>> plan.finish < plan.finish_latest
        True
    """

    @property
    def _told(self) -> dict[str, Any]:
        run_list, forecast = self.checked.run_list, self.forecast
        return {
            "procedure": self.checked.procedure.name,
            "bench": self.checked.bench.name,
            "points": len(run_list),
            "replications": self.checked.procedure.replications,
            "whole_plots": run_list.whole_plots,
            "run_list": run_list.sha256(),
            "seconds": {
                "preparation": forecast.preparation_s,
                "point": forecast.point_s,
                "soak": forecast.soak_s,
                "by_hand": forecast.by_hand_s,
                "total": forecast.total_s,
                "latest": forecast.latest_s,
            },
            "rehearsed_points": forecast.rehearsed,
            "by_hand": [
                {
                    **step.as_json(),
                    "before": step.before + 1,
                    "about": time_of(self, step).isoformat(timespec="minutes"),
                }
                for step in run_list.steps
            ],
            "assumed": forecast.assumed,
            "finish": self.finish.isoformat(timespec="minutes"),
            "finish_latest": self.finish_latest.isoformat(timespec="minutes"),
            "precision": self.precision.rows,
            "total": [one.to_json() for one in self.promised.results],
            "uncertainty": [*self.promised.lacking, *self.promised.notes],
            "reach": run_list.extremes(),
            "limits": for_people.limits(self.checked),
            "scatter_without_limit": for_people.unlimited(self.checked),
            "unasked": unasked(self.checked.bench),
            "cannot_be_asked": cannot_be_asked(self.checked.bench),
            "overdue": self.overdue,
            "not_on_bench": beside(self.checked),
            "not_stated": not_stated(self.checked),
            "stops_certificate": self._stops,
            "surroundings": surroundings(self.checked),
            "disk_free_bytes": self.disk[0],
            "disk_needed_bytes": self.disk[1],
            "environment": for_people.environment(self.checked),
            "advice": [
                {"number": a.number, "recommendation": a.recommendation, "holds": a.holds, "sentence": a.sentence}
                for a in self.advice
            ],
        }

    @property
    def _stops(self) -> Sequence[str]:
        return stops(self.checked, self.finish_latest.date())

    def blocks(self) -> Iterable[Block]:
        """Lines for people."""
        return for_people.blocks(self)

    def frame(self) -> Frame:
        """The predicted precision."""
        rows = self.precision.rows
        text = [name for name in rows[0] if any(isinstance(row.get(name), str) for row in rows)]
        numbers = [name for name in rows[0] if name not in text]
        units = {name: unit for name in numbers if (unit := known_unit_of(name))}
        return of_rows(rows, text, numbers, {"procedure": self.checked.procedure.name}, units)

    def plot(self) -> Plots:
        """One figure: the setting of every factor, point by point."""
        from rig.procedures.present.pictures import grid  # noqa: PLC0415 - matplotlib takes a second to import

        run_list = self.checked.run_list
        settings = [run_list.setting(point) for point in run_list.points]
        figure, axes = grid(len(run_list.factors), columns=1, height=2.0)
        for axis, factor in zip(axes, run_list.factors, strict=True):
            unit = known_unit_of(factor.name)
            axis.plot(np.arange(len(settings)) + 1, [one[factor.name] for one in settings], ".", ms=3)
            axis.set_title(f"{factor.name.removesuffix(f'_{unit}')} / {unit}", fontsize=9)
            axis.set_xlabel("point, in the order of running", fontsize=8)
        return Plots((figure,))

    def __repr__(self) -> str:
        return f"<rig.Plan of {self.checked.procedure.name}: {len(self.checked.run_list)} points>"


def plan(
    procedure: str | Path,
    bench: str | Path,
    *,
    out: str | Path = "runs",
    usage: float | None = None,
    world: str | Path | None = None,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Plan:
    """Forecast a run: number of points, time of its end, precision, and problems.

    Args:
        procedure: the procedure file.
        bench: the bench file.
        out: folder of the run file.
        usage: range of use of the sensors, plus and minus, degrees, for kinds that have one; that of the procedure if
            None.
        world: a world file: the plan is of a dry run in it, on its day, with its time constants; None for a real run.
        on_progress: called with the progress of the rehearsal, as in a run.

    Raises:
        ConfigurationError: a file is wrong, or the design does not determine a sensor.
        UsageError: `usage` is given, and this kind has none.
        RigError: the rehearsal failed.

    Example:
        >>> rig.plan("procedure.toml", "bench.toml")
        <rig.Plan of few angles: 12 points>
    """
    checked = load_plan(
        Path(procedure), Path(bench), dry=world is not None, world=None if world is None else Path(world)
    )
    if world is not None:
        _check_world(checked, str(world))
    try:
        precise = kind_of(checked.procedure).precision(checked.procedure, checked.run_list)
    except FitError as error:
        why = f"the design does not determine a sensor: {error}; use more settings"
        raise ConfigurationError(f"{procedure}: {why}") from error
    doubts = [Advice(0, "units", False, sentence) for sentence in unit_doubts(checked)]
    of_settling = (*short_dwells(checked), *narrow_bands(checked), *unread(checked))
    doubts += [Advice(0, "dwell", False, sentence) for sentence in of_settling]
    advice = [*_advice(checked, usage), *doubts]
    forecast = rehearse(checked, on_progress)
    now = _now(checked)
    folder = Path(out)
    existing = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    disk = shutil.disk_usage(existing).free, needed_bytes(len(checked.run_list))
    ends = now + timedelta(seconds=forecast.latest_s)
    return Plan(checked, precise, advice, forecast, now, disk, promised(checked, ends.date()))


def _check_world(checked: Checked, world: str) -> None:
    """Refuse a world file that does not fit the bench, as the dry run would. Raises `ConfigurationError`."""
    from rig.simulated.dry_run import DryBench  # noqa: PLC0415 - few plans are of dry runs

    DryBench(checked.bench, checked.truth, where=world).close()


def _now(checked: Checked) -> datetime:
    """Bench time at which a run would begin: of a dry run and of a bench of `rig sim`, that of its world."""
    if checked.dry:
        from rig.simulated.calendar import begins  # noqa: PLC0415 - few plans are of dry runs

        return begins(checked.truth, checked.bench, checked.documents.get(DOCUMENT))
    live = checked.bench.live
    clock = ScaledClock(live.speed, live.epoch_utc, live.started_utc) if live else RealClock()
    return datetime.fromtimestamp(clock.utc(), UTC).astimezone()


def _advice(checked: Checked, usage_deg: float | None) -> Sequence[Advice]:
    axes = [s.axis for s in checked.bench.sensors.values() if s.axis is not None]
    try:
        return kind_of(checked.procedure).advice(checked.procedure, axes, usage_deg)
    except FitError as error:
        raise UsageError(str(error)) from error
