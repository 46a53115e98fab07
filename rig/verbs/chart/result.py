"""`rig chart`: several calibrations of one sensor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, date, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.drivers.clock import RealClock
from rig.errors import UsageError
from rig.fitter.rounding import with_error
from rig.procedures.present.blocks import Block, Grid, Line, simulated_mark
from rig.verbs.chart.charted import ControlCharts, chart_calibrations
from rig.verbs.chart.sentences import due_date
from rig.verbs.chart.together import read_together
from rig.verbs.data.registered import REPEATABILITY
from rig.verbs.data.result import Data
from rig.verbs.frames import Frame, of_rows
from rig.verbs.result import Reported

if TYPE_CHECKING:
    from rig.procedures.evaluate.charting import View
    from rig.procedures.evaluate.results import Page


class ControlChart(Reported):
    """Parameters of sensors over several calibrations, and the due date of the last.

    Attributes:
        charted: every sensor.

    Example:
        >>> for year in ("2025", "2026"):
        ...     rig.open(f"cell-{year}.csv").fit(response="y_V", formula="1 + x_mm").save(f"{year}.json")
        >>> chart = rig.chart(["2025.json@2025-01-15", "2026.json@2026-01-15"], tolerance=0.1, today="2026-02-01")
        >>> chart.to_pandas()["date"].nunique()
        2
    """

    def __init__(self, charted: ControlCharts) -> None:
        self.charted = charted

    @cached_property
    def _told(self) -> dict[str, Any]:
        return {**self.charted.to_json(), "uncertainty": REPEATABILITY}

    def blocks(self) -> Iterable[Block]:
        """Lines for people."""
        given = self.charted.given
        mark = simulated_mark(self.charted.simulated)
        yield Line(f"{mark}[bold]{len(given)} calibrations[/] from {given[0].date} to {given[-1].date}")
        for name, found in self._told["sensors"].items():
            yield from _sensor(name, self.charted.sensors[name].view, found)
        yield Line(f"  [yellow]standard errors, limits and due dates: {REPEATABILITY}[/]")
        for note in self.charted.notes:
            yield Line(f"  [yellow]{escape(note)}[/]")

    @cached_property
    def _page(self) -> Page:
        from rig.verbs.chart.page import chart_page  # noqa: PLC0415 - matplotlib takes a second to import

        return chart_page(self.charted)

    def as_drift(self) -> str:
        """Lines of `equipment.toml`: the drift of every sensor since its last calibration. Raises `UsageError`."""
        found, mark = [], "SIMULATED: " if self.charted.simulated else ""
        for name, one in self.charted.sensors.items():
            rows = ", ".join(f"[{days:g}, {error:g}]" for days, error in one.drift())
            found.append(
                f"# {mark}{name}, calibrated on {one.last:%Y-%m-%d}: drift not exceeded with 95 %, "
                f"{one.view.usage_words}; rig chart of {len(one.given)} calibrations\n"
                f"drift = [{rows}]\ndrift_unit = '{one.view.unit}'\n"
            )
        return "\n".join(found)

    def frame(self) -> Frame:
        """One row per calibration, sensor and parameter."""
        text, numbers = ("sensor", "date", "file", "parameter"), ("estimate", "stderr")
        return of_rows(self._rows(), text, numbers, {"simulated": int(self.charted.simulated)})

    def _rows(self) -> Iterator[dict[str, Any]]:
        for sensor, found in self._told["sensors"].items():
            for one in found["calibrations"]:
                for parameter, value in one["parameters"].items():
                    yield {**one, **value, "sensor": sensor, "parameter": parameter}

    def __repr__(self) -> str:
        return f"<rig.ControlChart of {', '.join(self.charted.sensors)}: {len(self.charted.given)} calibrations>"


def chart(
    calibrations: Sequence[str | Path | Data],
    *,
    tolerance: float | None = None,
    usage: float | None = None,
    sensors: Sequence[str] = (),
    formula: str | None = None,
    today: str | date | None = None,
) -> ControlChart:
    """Chart the parameters of sensors over several calibrations: drift, and the next due date.

    Args:
        calibrations: run files, calibration files, or CSV tables with their date as in "table.csv@2026-01-15".
        tolerance: maximum permitted error of the last calibration's output, in its unit; None for the 95 % interval of
            one reading.
        usage: range of use, plus and minus, degrees, for kinds that have one; None for the range of the last
            calibration.
        sensors: chart only these, such as "x_V".
        formula: whole plots: the model, if not the declared one.
        today: date for "in N days".

    Raises:
        UsageError: fewer than two calibrations can be charted together, or a file cannot be used.
        DataError: a table does not determine its model.

    Example:
        >>> for year in ("2025", "2026"):
        ...     rig.open(f"cell-{year}.csv").fit(response="y_V", formula="1 + x_mm").save(f"{year}.json")
        >>> rig.chart(["2025.json@2025-01-15", "2026.json@2026-01-15"], tolerance=0.1, today="2026-02-01")
        <rig.ControlChart of y_V: 2 calibrations>
    """
    files = [str(one.path) if isinstance(one, Data) else str(one) for one in calibrations]
    given, left_out = read_together(files, formula, sensors)
    when = _today(today)
    return ControlChart(
        chart_calibrations(given, when, sensors=sensors, tolerance=tolerance, usage_deg=usage, left_out=left_out)
    )


def _today(given: str | date | None) -> datetime:
    if given is None:
        return datetime.fromtimestamp(RealClock().utc(), UTC)
    try:
        moment = datetime.fromisoformat(str(given))
    except ValueError:
        raise UsageError(f"--today: {given!r} is not a date; write 2026-01-15") from None
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


def _sensor(name: str, view: View, found: Mapping[str, Any]) -> Iterator[Block]:
    rows = found["calibrations"]
    grid = Grid(("date", *rows[0]["parameters"], "outside"), title=f"\n{escape(name)}, {escape(found['model'])}")
    cells = [[with_error(v["estimate"], v["stderr"]) for v in row["parameters"].values()] for row in rows]
    alike = all([error for _, error in each] == [error for _, error in cells[0]] for each in cells)
    for row, each in zip(rows, cells, strict=True):
        outside = ", ".join(f"{view.shown[q].label} {limit}" for q, limit in row["outside"].items())
        values = [value if alike else f"{value} +- {error}" for value, error in each]
        grid.add_row(row["date"], *values, f"[yellow]{outside}[/]" if outside else "")
    if alike:
        grid.add_row(*(f"[dim]{cell}[/]" for cell in ("std. error", *(error for _, error in cells[0]), "")))
    yield grid
    if not alike:
        yield Line("  values +- one standard error")
    for sentence in found["sentences"]:
        yield Line(f"  {escape(sentence)}")
    if "by_variation" not in found["due"]:
        return  # no due date can be told at all, which a sentence says
    due_dates = Grid((f"tolerance / {found['due']['unit']}", "due", "if calibrations scatter", "for a random walk"))
    for due in found["due_by_tolerance"]:
        by_variation = (value or "-" for value in due["by_variation"].values())
        due_dates.add_row(f"{due['tolerance']:.2g}", due_date(due), *by_variation)
    yield due_dates
    yield Line(f"  (95 % probability, {view.usage_words}; the earlier of both)")
