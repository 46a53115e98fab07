"""A plan in lines for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.bench.approach import Approach
from rig.bench.bench_file import NO_QUESTION, cannot_be_asked, playing, unasked
from rig.bench.plugins import driver_class
from rig.bench.scatter_limits import without_limit
from rig.bench.typed import typed_columns
from rig.drivers.roles import ByHand, Chamber
from rig.engine.guard import Guard
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.hand_steps import ALLOWANCE_H
from rig.procedures.present.blocks import Block, Grid, Line
from rig.procedures.present.durations import duration
from rig.register import DOCUMENT
from rig.runs.forecast import ALLOWANCE, SOAK_ALLOWANCE
from rig.verbs.plan.dwells import own_readings
from rig.verbs.plan.expected import time_of
from rig.verbs.plan.foreseen import beside, has_due_date, not_stated, stops, surroundings

if TYPE_CHECKING:
    from rig.runs.plans import Plan as Checked
    from rig.verbs.plan.expected import Expected

VALID = "every calibration whose date is stated is valid until then"
NO_DUE_DATE = (
    "no due date of any calibration is stated, in the bench file or in a register: whether one expires until then is "
    "not known"
)


def blocks(planned: Expected) -> Iterator[Block]:
    """All lines of a plan."""
    checked, run_list = planned.checked, planned.checked.run_list
    yield Line(f"[bold]{escape(checked.procedure.name)}[/] on {escape(checked.bench.name)}")
    plots = f"{run_list.whole_plots} whole plots, " if run_list.whole_plots else ""
    yield Line(f"  {len(run_list)} points, {plots}{checked.procedure.replications} replication(s)")
    yield from _time(planned)
    yield from _by_hand(planned)
    yield from _read_by_hand(planned)
    yield from _precise(planned)
    yield from _promised(planned)
    yield from _advised(planned)
    yield from _in_the_way(planned)


def _precise(planned: Expected) -> Iterator[Block]:
    precise = planned.precision
    if precise.cells:
        grid = Grid(precise.columns, title="Predicted precision, by the scatter of readings alone")
        for row in precise.cells:
            grid.add_row(*row)
        yield grid
    yield from (Line(f"  {escape(line)}") for line in precise.further)
    if precise.assuming:
        yield Line(f"  ({escape(precise.assuming)})")


def _promised(planned: Expected) -> Iterator[Block]:
    yield from (Line(f"  [bold]not in the totals:[/] {escape(one)}") for one in planned.promised.lacking)
    if planned.promised.results:
        grid = Grid(("result", "total, 95 %", "repeatability", "largest influence", "more points gain at most"))
        for one in planned.promised.results:
            total, scatter = (f"+-{value:.2g} {one.unit}" for value in (one.expanded, one.repeatability))
            gain = 100.0 * (1.0 - one.limit / one.expanded)
            grid.add_row(one.name, total, scatter, f"{one.dominant}, {100 * one.share:.0f} %", f"{gain:.1f} %")
        yield grid
    yield from (Line(f"  ({escape(note)})") for note in planned.promised.notes)


def _time(planned: Expected) -> Iterator[Block]:
    found = planned.forecast
    begun = f"a dry run in this world begins {_when(planned.now)} and" if planned.checked.dry else "started now, it"
    yield Line(f"  {begun} ends {_when(planned.finish)} ({duration(found.total_s)}),")
    yield Line(f"  at the latest {_when(planned.finish_latest)}")
    if day := _dry_day(planned.checked):
        yield Line(f"  with --dry it begins on {day}")
    soaks = (
        "" if found.soak_s is None else f" with the first whole plot, {duration(found.soak_s)} to set each further one"
    )
    yield Line(f"  {found.point_s:.1f} s per point (sd {found.point_sd_s:.1f} s, {found.rehearsed} points rehearsed),")
    yield Line(f"  {duration(found.preparation_s)} of preparation{soaks};")
    for_soaks = "" if found.soak_s is None else f" and {SOAK_ALLOWANCE:.0%} for setting whole plots"
    yield Line(f"  the latest time allows {ALLOWANCE:.0%} for repeats and retries{for_soaks}")
    yield from (Line(f"  {escape(line)}") for line in found.assumed)


def _by_hand(planned: Expected) -> Iterator[Block]:
    """Steps that a person does: what, and about when."""
    steps, points = planned.checked.run_list.steps, len(planned.checked.run_list)
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
        yield Line(f"    about {_when(time_of(planned, step))}, {where}: {escape(step.instruction)}{value}")


def _read_by_hand(planned: Expected) -> Iterator[Block]:
    """Readings that a person takes."""
    points = len(planned.checked.run_list)
    for name, one in typed_columns(planned.checked.bench, planned.checked.procedure.conduct).items():
        twice = ", twice" if one.readings > 1 else ""
        yield Line(
            f"  [yellow]{escape(one.reader)} reads {escape(name)}[/] ({escape(one.channel)}) at each of "
            f"{points} points{twice}; the run holds until `rig done`"
        )


def _advised(planned: Expected) -> Iterator[Block]:
    yield from (Line(f"  [yellow]advice:[/] {escape(a.sentence)}") for a in planned.advice if not a.holds)
    followed = [str(a.number) for a in planned.advice if a.holds and a.number]
    if followed:
        numbers = ", ".join(followed)
        yield Line(f"  follows the paper's recommendations {numbers}; --json has the numbers")


def _in_the_way(planned: Expected) -> Iterator[Block]:
    checked = planned.checked
    people = playing(checked.bench, ByHand)
    for name, reach in checked.run_list.extremes().items():
        by_hand = checked.bench.factors.get(name) in people
        asked = checked.run_list.column(name)
        low, high = (min(asked), max(asked)) if by_hand else reach
        beyond = low < min(asked) or high > max(asked)
        how = ", set by a person" if by_hand else ", with overtravel" if beyond else ""
        allowed = limits(checked).get(name)
        no_limit = "[yellow]no limit in the bench file[/]"
        shown = f"limits {allowed[0]:g} to {allowed[1]:g}: ok" if allowed else no_limit
        yield Line(f"  {name} from {low:g} to {high:g}{how}; {shown}")
    yield from _first_settings(checked)
    if columns := unlimited(checked):
        alone = checked.procedure.conduct.readings == 1
        how = "one reading a point has none" if alone else "it is compared with the run's own scatter"
        yield Line(f"  no limit for the scatter of {escape(', '.join(columns))}: {how}")
    if names := unasked(checked.bench):
        words = "no question of `check` shows whether somebody has changed its unit, channel or range"
        yield Line(f"  {escape(', '.join(names))}: {words}")
    if names := cannot_be_asked(checked.bench):
        yield Line(f"  {escape(', '.join(names))}: {NO_QUESTION}")
    yield from (Line(f"  {escape(one)}") for one in own_readings(checked))
    if wanted := environment(checked):
        yield Line(f"  environment: {escape(wanted)}")
    yield from (Line(f"  [yellow]{escape(line)}[/]") for line in planned.overdue)
    if not planned.overdue:
        yield Line(f"  {VALID if has_due_date(checked) else NO_DUE_DATE}")
    yield from (Line(f"  {escape(one)}") for one in surroundings(checked))
    yield from of_certificate(planned)
    if names := beside(checked):
        yield Line(f"  in the register and not on the bench: {escape(', '.join(names))}")
    free, needed = planned.disk
    verdict = "ok" if free > needed else "[red]not enough[/]"
    yield Line(f"  disk: needs {needed / 1e6:.0f} MB, {free / 1e9:.1f} GB free: {verdict}")


def _first_settings(checked: Checked) -> Iterator[Block]:
    """The first setting of every level, and which levels are beyond the table of approach."""
    levels = {factor.name: sorted(set(checked.run_list.column(factor.name))) for factor in checked.run_list.factors}
    for name, of in checked.bench.steered.items():
        if name not in levels:
            continue
        table = Approach.of(checked.bench.references[name].approach or ())
        first = ", ".join(f"{level:g} at {table.setting(level):.4g}" for level in levels[name])
        near = checked.procedure.conduct.near[name]
        yield Line(
            f"  {name} is set by {of}, first as in its table of approach, then corrected until its standard reads the "
            f"level within {near:.3g} {spelled(unit_of(name))}: {first} {spelled(unit_of(of))}"
        )
        if beyond := [f"{level:g}" for level in levels[name] if not table.covers(level)]:
            yield Line(
                f"  [yellow]{name} = {', '.join(beyond)} is beyond the table of approach[/]: the first setting goes on "
                f"as at its end"
            )


def of_certificate(planned: Expected) -> Iterator[Line]:
    """Lines of a plan that say what a certificate of its run lacks: one reason beside the word, several below it."""
    stop = stops(planned.checked, planned.finish_latest.date())
    refused = "[yellow]a certificate would be refused:[/]"
    for what, told in ((refused, stop), ("a certificate would say:", not_stated(planned.checked))):
        if len(told) == 1:
            yield Line(f"  {what} {escape(told[0])}")
        elif told:
            yield Line(f"  {what}")
            yield from (Line(f"    - {escape(one)}") for one in told)


def limits(checked: Checked) -> Mapping[str, tuple[float, float]]:
    """Limits of the bench by quantity."""
    return Guard(checked.bench.limits, checked.bench.factors).limits


def unlimited(checked: Checked) -> Sequence[str]:
    """Columns whose scatter has no declared limit."""
    return without_limit(checked.procedure.conduct, checked.bench)


def _dry_day(checked: Checked) -> str:
    """Date of a dry run by the register, and why; "" without a register, or if this one is dry or live."""
    text = checked.documents.get(DOCUMENT)
    if checked.dry or checked.bench.live is not None or text is None:
        return ""
    from rig.simulated.calendar import why  # noqa: PLC0415 - few plans have a register

    return why({}, checked.bench, text)


def _when(moment: datetime) -> str:
    return f"{moment:%A %Y-%m-%d %H:%M} {_zone(moment)}"


def _zone(moment: datetime) -> str:
    """The zone's name and its offset, since names are not unique; only the offset if there is no other name."""
    offset, name = f"{moment:%z}", moment.tzname() or ""
    offset = f"UTC{offset[:3]}:{offset[3:5]}"
    return name if name == "UTC" else f"{name} ({offset})" if name.isalpha() else offset


def environment(checked: Checked) -> str | None:
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
