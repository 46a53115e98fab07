"""Remaining time of a run of whole plots: predicted from the plan, corrected by the durations observed so far.

A chamber ramps, and its contents follow with a time constant tau. At the end of a ramp of rate r and length t the
sensors lag by r tau (1 - exp(-t / tau)). They have settled when this lag is within the tolerance and its slope is
within the permitted drift. The time for a change of pressure follows from its slew rate. Both predictions are corrected
by the median of the ratios, or differences, observed in the run. Observations near a new start, a fault or a hold do
not count. Nothing is predicted of settings that are no temperatures: they take as long as the ones before.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, inf, log

import numpy as np

from rig.bench.config import FOLLOWS_S, BenchConfig
from rig.bench.plugins import driver_class
from rig.errors import ConfigurationError
from rig.procedures.column_names import unit_of
from rig.procedures.plan.conduct import Conduct, SoakSettings
from rig.procedures.plan.run_list import RunList
from rig.run_file.chain import Record
from rig.run_file.events.bench import Fault
from rig.run_file.events.by_hand import AskedByHand
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed, Skipped, TemperaturesLeft, WholePlotBegan, WholePlotLost
from rig.run_file.events.sessions import Held, SessionBegan, Stopped
from rig.units.of_instruments import TEMPERATURE_UNIT

AMBIENT_DEGC = 23.0
"""Temperature before the first soak of a run, degrees Celsius."""
SWEEP_S = 3.0
"""Assumed duration of a reading of all channels before the first one, seconds."""
KEPT = 200
"""Number of the last durations of each kind that an estimate uses; chosen."""
_NOT_CLEAN = (Fault, Held, AskedByHand, SessionBegan, Stopped, Skipped)


@dataclass(frozen=True)
class Follower:
    """One chamber and its contents.

    Attributes:
        ramp_degC_per_s: rate of its setpoint.
        follows_s: time constant with which the sensors follow; 0 where nothing shows how they do.
        tolerance_degC: of what has to settle; a source that does not ramp follows, too, and its own reading counts.

    """

    ramp_degC_per_s: float
    follows_s: float
    tolerance_degC: float

    def settled_s(self, change_degC: float, soak: SoakSettings) -> float:
        """Seconds from the command until the last dwell begins: within tolerance, with a drift over it in its limit.

        The drift of a single exponential is the least-squares slope over the dwell, which is less than that at its
        begin. The air and walls of a chamber with a ramp come late, too, which takes about as much longer.
        """
        ramp = change_degC / self.ramp_degC_per_s
        tau = self.follows_s
        if not tau:
            return ramp
        behind = self.ramp_degC_per_s * tau * (1.0 - exp(-ramp / tau)) if ramp > 0 else change_degC
        lessens = _slope_over(soak.dwell_s / tau) if self.ramp_degC_per_s == inf else 1.0
        allowed = min(self.tolerance_degC, soak.drift_degC_per_h / 3600.0 * tau / lessens)
        return ramp + tau * log(max(behind / allowed, 1.0))


@dataclass(frozen=True)
class _Left:
    """Remaining work: points, durations of their changes, whole plots to soak, and whether a soak comes first.

    Also what follows from it until the next record: the seconds of each soak, and of everything else.
    """

    travel_s: float
    points: int
    plots: tuple[int, ...]
    soak_next: bool
    soaks: tuple[float, ...] = ()
    without_soaks_s: float = 0.0


class Pace:
    """The estimate for one run of whole plots; takes every record in order, those of earlier sessions first.

    Args:
        run_list: every point.
        conduct: soak, settling and measuring.
        bench: rates of its instruments, and how sensors follow.

    """

    def __init__(self, run_list: RunList, conduct: Conduct, bench: BenchConfig) -> None:
        assert conduct.whole_plots is not None
        self._soak = conduct.whole_plots.soak
        numbers = [p.whole_plot or 0 for p in run_list.points]
        self._plot = np.array(numbers)
        self._open = np.ones(len(numbers), np.bool_)
        self._travel = _travel_s(run_list, bench)
        followers = _followers(run_list, bench, self._soak)
        self._soaks, self._soak_free = _soaks_s(run_list, self._soak, followers), not followers
        self._point_s = _point_s(run_list, conduct, bench)
        self._points: deque[float] = deque(maxlen=KEPT)
        self._ratios: deque[float] = deque(maxlen=KEPT)
        self._settings: deque[float] = deque(maxlen=KEPT)
        self._planned: int | None = None
        self._began: tuple[int, float] | None = None
        self._soaking_s: float | None = None  # since when a soak goes on; unlike `_began` through faults and holds
        self._last: tuple[int, int | None, float] | None = None
        self._left: _Left | None = None

    @property
    def point_s(self) -> float:
        """Seconds of a point without its change of pressure."""
        return statistics.median(self._points) if self._points else self._point_s

    @property
    def ratio(self) -> float:
        """Ratio of the duration of soaks to the prediction."""
        return statistics.median(self._ratios) if self._ratios else 1.0

    def add(self, record: Record) -> None:
        """Take the next record."""
        if record.accepted:
            self._observed(record)
        elif record.kind != Observed.kind:
            self._happened(record, record.event)

    def _observed(self, record: Record) -> None:
        index, plot = record.run_index, record.whole_plot
        assert index is not None
        if self._last is not None and self._last[:2] == (index - 1, plot):
            self._points.append(max(record.elapsed_s - self._last[2] - float(self._travel[index]), 0.0))
        self._last = index, plot, record.elapsed_s
        self._soaking_s = None
        self._done(index)

    def _happened(self, record: Record, event: Event) -> None:
        if isinstance(event, _NOT_CLEAN):
            self._last = self._began = None
        match event:
            case SessionBegan():
                self._soaking_s = record.elapsed_s
            case AskedByHand():
                self._soaking_s = None  # a person comes before the soak
            case Skipped(final=True):
                assert record.run_index is not None
                self._done(record.run_index)
            case TemperaturesLeft():
                self._began, self._soaking_s = (event.planned, record.elapsed_s), record.elapsed_s
            case WholePlotBegan():
                self._planned = event.planned
                if self._soak_free and self._last is not None:
                    self._settings.append(record.elapsed_s - self._last[2])
                if self._began is not None and self._began[0] == self._planned:
                    self._ratios.append((record.elapsed_s - self._began[1]) / self._soaks[self._planned])
                self._began = self._left = self._soaking_s = None
            case WholePlotLost():
                self._open[event.first : event.first + event.count] = True
                self._planned = self._last = self._left = self._soaking_s = None
            case _:
                pass

    def _done(self, index: int) -> None:
        self._open[index] = False
        self._left = None

    def interrupted(self, elapsed_s: float) -> None:
        """Note the end of a session: an unfinished soak begins again with the next one."""
        self._last = self._began = None
        self._soaking_s = elapsed_s

    def remaining_s(self, elapsed_s: float) -> float:
        """Remaining bench seconds at an elapsed time."""
        if self._left is None:
            self._left = self._what_is_left()
        left = self._left
        soaks = list(left.soaks)
        if left.soak_next and self._soaking_s is not None:
            soaks[0] = max(soaks[0] - max(elapsed_s - self._soaking_s, 0.0), 0.0)
        return left.without_soaks_s + sum(soaks)

    def _what_is_left(self) -> _Left:
        plots = dict.fromkeys(self._plot[self._open].tolist())
        soaks = tuple(plot for plot in plots if plot != self._planned)
        soak_next = bool(plots) and next(iter(plots)) != self._planned
        travel_s, points = float(self._travel[self._open].sum()), int(self._open.sum())
        ratio = self.ratio
        setting = statistics.median(self._settings) if self._settings else 0.0
        return _Left(
            travel_s,
            points,
            soaks,
            soak_next,
            tuple([setting if self._soak_free else self._soaks[plot] * ratio for plot in soaks]),
            travel_s + points * self.point_s,
        )


def _travel_s(run_list: RunList, bench: BenchConfig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """(n,) seconds for the changes of easy factors, by their rates; 0 if a rate is not declared."""
    slowest = np.zeros(len(run_list))
    for at, factor in enumerate(run_list.factors):
        rate = None if factor.hard else _rate(bench, factor.name, "slew_psi_per_s")
        if rate is not None:
            values = np.array([p.setpoints[at] for p in run_list.points])
            slowest = np.maximum(slowest, np.abs(np.diff(values, prepend=values[:1])) / rate)
    return slowest


def _point_s(run_list: RunList, conduct: Conduct, bench: BenchConfig) -> float:
    """Predicted seconds of a point without its changes: the wait, that of the slowest setter, and the readings.

    Durations are those of the bench file; one that it does not say is assumed.
    """
    own = [_rate(bench, factor.name, "dwell_s") for factor in run_list.easy]
    readers = {one.reader for one in bench.sensors.values()} | {one.reader for one in bench.references.values()}
    options = [bench.instruments[name].options for name in readers]
    known = [(float(one["reading_s"]), "start" in one) for one in options if "reading_s" in one]
    together = max((s for s, started in known if started), default=0.0)
    one_by_one = sum(s for s, started in known if not started)  # a meter that is not started reads when it is asked
    sweep_s = together + one_by_one if known and len(known) == len(options) else SWEEP_S
    wait_s = conduct.settle.dwell_s
    return wait_s + max((one for one in own if one is not None), default=wait_s) + sweep_s * conduct.readings


def _rate(bench: BenchConfig, factor: str, option: str) -> float | None:
    given = bench.instruments[bench.setters[factor]].options.get(option) if factor in bench.setters else None
    return float(given) if isinstance(given, int | float) and given > 0 else None


def _slope_over(dwells: float) -> float:
    """The least-squares slope of exp(-t) from 0 to `dwells`, beside that at 0: 1 for a short time, less for a long one.

    Example:
        >>> round(_slope_over(0.001), 3), round(_slope_over(2.0), 3)
        (1.0, 0.406)
    """
    x = dwells
    if x < 0.01:  # the differences of a short time round
        return 1.0
    return 12.0 / x**3 * (0.5 * x * (1.0 - exp(-x)) - (1.0 - exp(-x) * (1.0 + x)))


def _followers(run_list: RunList, bench: BenchConfig, soak: SoakSettings) -> Mapping[str, Follower]:
    out = {}
    for factor in run_list.hard:
        if unit_of(factor.name) != TEMPERATURE_UNIT:
            continue
        rate = _rate(bench, factor.name, "ramp_degC_per_min")
        tolerance = soak.sensor_tolerance_degC if rate else min(soak.sensor_tolerance_degC, soak.tolerance_degC)
        tau = follows_s(bench, factor.name) if is_read(bench, factor.name) else 0.0
        out[factor.name] = Follower(inf if rate is None else rate / 60.0, tau, tolerance)
    return out


def is_read(bench: BenchConfig, factor: str) -> bool:
    """Whether something reads what a hard factor is: a thermometer, or its instrument if that has no `read` to say."""
    entry = bench.instruments.get(bench.setters.get(factor, ""))
    if bench.thermometers(factor) or entry is None or entry.options.get("read"):
        return True
    try:
        return "read" not in driver_class(entry.driver).Options.model_fields
    except ConfigurationError:  # an instrument that was given to the engine as it is
        return True


def follows_s(bench: BenchConfig, factor: str) -> float:
    """Time constant with which what is measured at a hard factor follows its setting, seconds; assumed if not said.

    It is that of its thermometers, or of a bath, which has to arrive itself: the largest of them.
    """
    thermometers = [bench.temperatures[name].follows_s for name in bench.thermometers(factor)]
    said = (*thermometers, _rate(bench, factor, "time_constant_s"))
    return max((one for one in said if one is not None), default=FOLLOWS_S)


def _soaks_s(run_list: RunList, soak: SoakSettings, followers: Mapping[str, Follower]) -> dict[int, float]:
    """Predicted seconds of each whole plot's soak, starting from the previous whole plot."""
    out: dict[int, float] = {}
    at = dict.fromkeys(followers, AMBIENT_DEGC)
    for point in run_list.points:
        if point.whole_plot is None or point.whole_plot in out:
            continue
        to = {name: value for name, value in run_list.setting(point).items() if name in followers}
        changes = {name: abs(value - at[name]) for name, value in to.items()}
        if max(changes.values(), default=0.0) < soak.renew_degC:
            changes = dict.fromkeys(changes, soak.renew_degC)
        settled = max((followers[name].settled_s(change, soak) for name, change in changes.items()), default=0.0)
        out[point.whole_plot] = settled + (soak.dwell_s if followers else 0.0)
        at = to
    return out
