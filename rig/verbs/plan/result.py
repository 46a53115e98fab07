"""`rig plan`: forecast of a run."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.markup import escape

from rig.bench.bench_file import NO_QUESTION, cannot_be_asked, playing, unasked
from rig.bench.config import due_dates
from rig.bench.plugins import driver_class
from rig.bench.scatter_limits import without_limit
from rig.bench.typed import typed_columns
from rig.drivers.clock import RealClock, ScaledClock
from rig.drivers.roles import ByHand, Chamber
from rig.engine.guard import Guard
from rig.errors import ConfigurationError, UsageError
from rig.files.disk_space import needed_bytes
from rig.fitter.errors import FitError
from rig.procedures.kinds import kind_of
from rig.procedures.plan.advice import Advice
from rig.procedures.plan.hand_steps import ALLOWANCE_H, HandStep
from rig.procedures.present.blocks import Block, Grid, Line
from rig.procedures.present.durations import duration
from rig.procedures.tables.unused import known_unit_of
from rig.register import DOCUMENT
from rig.runs.forecast import ALLOWANCE, SOAK_ALLOWANCE, Forecast, rehearse
from rig.runs.plans import Plan as Checked
from rig.runs.plans import load_plan
from rig.verbs.frames import Frame, of_rows
from rig.verbs.plan.dwells import narrow_bands, own_readings, short_dwells, unread
from rig.verbs.plan.first_settings import first_settings
from rig.verbs.plan.foreseen import beside, expired, has_due_date, not_stated, registered, stops, surroundings
from rig.verbs.plan.promised import Promised, promised
from rig.verbs.plan.unit_doubts import unit_doubts
from rig.verbs.result import Plots, Result

if TYPE_CHECKING:
    from rig.engine.session import Progress
    from rig.procedures.plan.precision import Precision

VALID = "every calibration whose date is stated is valid until then"
NO_DUE_DATE = (
    "no due date of any calibration is stated, in the bench file or in a register: whether one expires until then is "
    "not known"
)


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result):
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

    checked: Checked
    precision: Precision
    advice: Sequence[Advice]
    forecast: Forecast
    now: datetime
    disk: tuple[int, int]
    promised: Promised

    @property
    def finish(self) -> datetime:
        """Expected end, without incidents."""
        return self.now + timedelta(seconds=self.forecast.total_s)

    @property
    def finish_latest(self) -> datetime:
        """Latest expected end."""
        return self.now + timedelta(seconds=self.forecast.latest_s)

    @property
    def overdue(self) -> Sequence[str]:
        """Instruments whose own calibration is due before the end, or has no known date, one sentence each."""
        on = self.finish_latest.date()
        return [*_due(self.checked, on), *expired(self.checked, self.now.date(), on)]

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
                {**step.as_json(), "before": step.before + 1, "about": self._at(step).isoformat(timespec="minutes")}
                for step in run_list.steps
            ],
            "assumed": forecast.assumed,
            "finish": self.finish.isoformat(timespec="minutes"),
            "finish_latest": self.finish_latest.isoformat(timespec="minutes"),
            "precision": self.precision.rows,
            "total": [one.to_json() for one in self.promised.results],
            "uncertainty": [*self.promised.lacking, *self.promised.notes],
            "reach": run_list.extremes(),
            "limits": self._limits,
            "scatter_without_limit": self._without_limit,
            "unasked": unasked(self.checked.bench),
            "cannot_be_asked": cannot_be_asked(self.checked.bench),
            "overdue": self.overdue,
            "not_on_bench": beside(self.checked),
            "not_stated": not_stated(self.checked),
            "stops_certificate": self._stops,
            "surroundings": surroundings(self.checked),
            "disk_free_bytes": self.disk[0],
            "disk_needed_bytes": self.disk[1],
            "environment": _environment(self.checked),
            "advice": [
                {"number": a.number, "recommendation": a.recommendation, "holds": a.holds, "sentence": a.sentence}
                for a in self.advice
            ],
        }

    @property
    def _stops(self) -> Sequence[str]:
        return stops(self.checked, self.finish_latest.date())

    @property
    def _dry_day(self) -> str:
        """Date of a dry run by the register, and why; "" without a register, or if this one is dry or live."""
        checked = self.checked
        text = checked.documents.get(DOCUMENT)
        if checked.dry or checked.bench.live is not None or text is None:
            return ""
        from rig.simulated.calendar import why  # noqa: PLC0415 - few plans have a register

        return why({}, checked.bench, text)

    @property
    def _limits(self) -> Mapping[str, tuple[float, float]]:
        return Guard(self.checked.bench.limits, self.checked.bench.factors).limits

    @property
    def _without_limit(self) -> Sequence[str]:
        """Columns whose scatter has no declared limit."""
        return without_limit(self.checked.procedure.conduct, self.checked.bench)

    def blocks(self) -> Iterable[Block]:
        """Lines for people."""
        checked, run_list = self.checked, self.checked.run_list
        yield Line(f"[bold]{escape(checked.procedure.name)}[/] on {escape(checked.bench.name)}")
        plots = f"{run_list.whole_plots} whole plots, " if run_list.whole_plots else ""
        yield Line(f"  {len(run_list)} points, {plots}{checked.procedure.replications} replication(s)")
        yield from self._time()
        yield from self._by_hand()
        yield from self._read_by_hand()
        yield from self._precise()
        yield from self._promised()
        yield from self._advised()
        yield from self._in_the_way()

    def _precise(self) -> Iterator[Block]:
        precise = self.precision
        if precise.cells:
            grid = Grid(precise.columns, title="Predicted precision, by the scatter of readings alone")
            for row in precise.cells:
                grid.add_row(*row)
            yield grid
        yield from (Line(f"  {escape(line)}") for line in precise.further)
        if precise.assuming:
            yield Line(f"  ({escape(precise.assuming)})")

    def _promised(self) -> Iterator[Block]:
        yield from (Line(f"  [bold]not in the totals:[/] {escape(one)}") for one in self.promised.lacking)
        if self.promised.results:
            grid = Grid(("result", "total, 95 %", "repeatability", "largest influence", "more points gain at most"))
            for one in self.promised.results:
                total, scatter = (f"+-{value:.2g} {one.unit}" for value in (one.expanded, one.repeatability))
                gain = 100.0 * (1.0 - one.limit / one.expanded)
                grid.add_row(one.name, total, scatter, f"{one.dominant}, {100 * one.share:.0f} %", f"{gain:.1f} %")
            yield grid
        yield from (Line(f"  ({escape(note)})") for note in self.promised.notes)

    def _time(self) -> Iterator[Block]:
        found = self.forecast
        begun = f"a dry run in this world begins {_when(self.now)} and" if self.checked.dry else "started now, it"
        yield Line(f"  {begun} ends {_when(self.finish)} ({duration(found.total_s)}),")
        yield Line(f"  at the latest {_when(self.finish_latest)}")
        if day := self._dry_day:
            yield Line(f"  with --dry it begins on {day}")
        soaks = (
            ""
            if found.soak_s is None
            else f" with the first whole plot, {duration(found.soak_s)} to set each further one"
        )
        yield Line(
            f"  {found.point_s:.1f} s per point (sd {found.point_sd_s:.1f} s, {found.rehearsed} points rehearsed),"
        )
        yield Line(f"  {duration(found.preparation_s)} of preparation{soaks};")
        for_soaks = "" if found.soak_s is None else f" and {SOAK_ALLOWANCE:.0%} for setting whole plots"
        yield Line(f"  the latest time allows {ALLOWANCE:.0%} for repeats and retries{for_soaks}")
        yield from (Line(f"  {escape(line)}") for line in found.assumed)

    def _by_hand(self) -> Iterator[Block]:
        """Steps that a person does: what, and about when."""
        steps, points = self.checked.run_list.steps, len(self.checked.run_list)
        if not steps:
            return
        times = "time" if len(steps) == 1 else "times"
        yield Line(
            f"  [yellow]a person must be there {len(steps)} {times}[/] ({ALLOWANCE_H:g} h are allowed for each); the "
            "run holds until `rig done`:"
        )
        for step in steps:
            value = f" (asks for {step.value})" if step.value else ""
            where = f"before point {step.before + 1} of {points}"
            yield Line(f"    about {_when(self._at(step))}, {where}: {escape(step.instruction)}{value}")

    def _read_by_hand(self) -> Iterator[Block]:
        """Readings that a person takes."""
        points = len(self.checked.run_list)
        for name, one in typed_columns(self.checked.bench, self.checked.procedure.conduct).items():
            twice = ", twice" if one.readings > 1 else ""
            yield Line(
                f"  [yellow]{escape(one.reader)} reads {escape(name)}[/] ({escape(one.channel)}) at each of "
                f"{points} points{twice}; the run holds until `rig done`"
            )

    def _at(self, step: HandStep) -> datetime:
        return self.now + timedelta(seconds=self.forecast.when_s(step, self.checked.run_list))

    def _advised(self) -> Iterator[Block]:
        yield from (Line(f"  [yellow]advice:[/] {escape(a.sentence)}") for a in self.advice if not a.holds)
        followed = [str(a.number) for a in self.advice if a.holds and a.number]
        if followed:
            numbers = ", ".join(followed)
            yield Line(f"  follows the paper's recommendations {numbers}; --json has the numbers")

    def _in_the_way(self) -> Iterator[Block]:
        checked = self.checked
        people = playing(checked.bench, ByHand)
        for name, reach in checked.run_list.extremes().items():
            by_hand = checked.bench.factors.get(name) in people
            asked = checked.run_list.column(name)
            low, high = (min(asked), max(asked)) if by_hand else reach
            beyond = low < min(asked) or high > max(asked)
            how = ", set by a person" if by_hand else ", with overtravel" if beyond else ""
            allowed = self._limits.get(name)
            no_limit = "[yellow]no limit in the bench file[/]"
            shown = f"limits {allowed[0]:g} to {allowed[1]:g}: ok" if allowed else no_limit
            yield Line(f"  {name} from {low:g} to {high:g}{how}; {shown}")
        yield from first_settings(checked)
        if self._without_limit:
            unlimited = ", ".join(self._without_limit)
            alone = self.checked.procedure.conduct.readings == 1
            how = "one reading a point has none" if alone else "it is compared with the run's own scatter"
            yield Line(f"  no limit for the scatter of {escape(unlimited)}: {how}")
        if names := unasked(checked.bench):
            words = "no question of `check` shows whether somebody has changed its unit, channel or range"
            yield Line(f"  {escape(', '.join(names))}: {words}")
        if names := cannot_be_asked(checked.bench):
            yield Line(f"  {escape(', '.join(names))}: {NO_QUESTION}")
        yield from (Line(f"  {escape(one)}") for one in own_readings(checked))
        environment = _environment(self.checked)
        if environment:
            yield Line(f"  environment: {escape(environment)}")
        yield from (Line(f"  [yellow]{escape(line)}[/]") for line in self.overdue)
        if not self.overdue:
            yield Line(f"  {VALID if has_due_date(checked) else NO_DUE_DATE}")
        yield from (Line(f"  {escape(one)}") for one in surroundings(checked))
        yield from of_certificate(self)
        if names := beside(checked):
            yield Line(f"  in the register and not on the bench: {escape(', '.join(names))}")
        free, needed = self.disk
        verdict = "ok" if free > needed else "[red]not enough[/]"
        yield Line(f"  disk: needs {needed / 1e6:.0f} MB, {free / 1e9:.1f} GB free: {verdict}")

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


def of_certificate(planned: Plan) -> Iterator[Line]:
    """Lines of a plan that say what a certificate of its run lacks: one reason beside the word, several below it."""
    stop = stops(planned.checked, planned.finish_latest.date())
    refused = "[yellow]a certificate would be refused:[/]"
    for what, told in ((refused, stop), ("a certificate would say:", not_stated(planned.checked))):
        if len(told) == 1:
            yield Line(f"  {what} {escape(told[0])}")
        elif told:
            yield Line(f"  {what}")
            yield from (Line(f"    - {escape(one)}") for one in told)


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


def _when(moment: datetime) -> str:
    return f"{moment:%A %Y-%m-%d %H:%M} {_zone(moment)}"


def _zone(moment: datetime) -> str:
    """The zone's name and its offset, since names are not unique; only the offset if there is no other name."""
    offset, name = f"{moment:%z}", moment.tzname() or ""
    offset = f"UTC{offset[:3]}:{offset[3:5]}"
    return name if name == "UTC" else f"{name} ({offset})" if name.isalpha() else offset


def _environment(checked: Checked) -> str | None:
    """Environment required by the procedure, or a sentence that the bench cannot control it; None if not required."""
    wanted = checked.procedure.conduct.environment
    if wanted is None:
        return None
    asked = f"{wanted.setpoint_degC:g} degC for {duration(wanted.dwell_s)}"
    drivers: dict[str, Any] = {n: driver_class(i.driver) for n, i in checked.bench.instruments.items()}
    names = [name for name, driver in drivers.items() if issubclass(driver, Chamber)]
    if not names:
        return f"the procedure requires {asked}; this bench has no instrument to control it"
    return f"{', '.join(names)}: {asked}"


def _due(checked: Checked, on: date) -> Iterator[str]:
    """Dates of the bench file that are over or missing; a person has none, and a register has that of its equipment."""
    known = registered(checked)
    asked = {
        name: one
        for name, one in checked.bench.instruments.items()
        if one.address and (one.due is not None or one.asset not in known)
    }
    for kind, names, due in due_dates(checked.bench.model_copy(update={"instruments": asked})):
        what = f"reference standard of {names}" if kind == "reference" else names
        if due is None and kind == "instrument":
            yield f"{names}: the bench file has no due date of its calibration"
        elif due is not None and due < on:
            yield f"{what}: its calibration is due {due}, before this run would end"
