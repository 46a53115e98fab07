"""Soaking whole plots and giving them up: applies the rules of whole plots to the bench."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any, NoReturn

from rig.drivers.clock import Clock
from rig.engine.actions import BenchActions
from rig.engine.axes import AxisReading
from rig.engine.by_hand.to_set import SetByHand
from rig.engine.fault_classes import NotSettled, TemperatureLeft, TemperaturesNotSettled
from rig.engine.hard_factors import HardFactors
from rig.engine.journal import Journal
from rig.engine.measuring import Channel
from rig.engine.queue import PointQueue
from rig.engine.whole_plots import WholePlots, without_power
from rig.instruments.opening import Bench
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file.events.event import EMPTY
from rig.run_file.events.points import Observed, Renewing, TemperaturesLeft, WholePlotBegan, WholePlotLost

_LOOK_S = 60.0
"""Time between looks at the open whole plot while a person is waited for, seconds."""
_RECALLED = 40
"""Number of observations read again when a run is resumed, to know the behaviour of the chambers."""


class Soaking:
    """Whole plots on one bench.

    Args:
        bench: opened instruments.
        run_list: every point of the run.
        conduct: soak, settling and recovery.
        do: actions on the bench.
        journal: where it is recorded.
        queue: points still to be observed.
        clock: bench time.
        wait: waits for this number of bench seconds; may raise to interrupt.
        settings: factors that a person sets.

    Attributes:
        rules: the rules of whole plots.
        watched: whether this session began the open whole plot or worked on it, and was there since then.

    Raises:
        ConfigurationError: the bench file names no chamber for a factor.

    """

    def __init__(
        self,
        *,
        bench: Bench,
        run_list: RunList,
        conduct: Conduct,
        do: BenchActions,
        journal: Journal,
        queue: PointQueue,
        clock: Clock,
        wait: Callable[[float], None],
        settings: SetByHand,
    ) -> None:
        assert conduct.whole_plots is not None
        self.rules = WholePlots(bench, run_list, conduct.whole_plots)
        self._run_list, self._soak, self._poll_s = run_list, conduct.whole_plots.soak, conduct.poll_s
        self._held, self._settings, self.watched = HardFactors(bench, run_list, conduct.settled), settings, False
        self._do, self._journal, self._queue = do, journal, queue
        self._clock, self._wait = clock, wait
        self._lost: Counter[int] = Counter()
        self._looked_s = self._seen_s = -inf
        self._away = ""
        # A dry run's bench lives in this process: the next session finds another one, switched on just now.
        self._anew = bench.config.simulated and bench.config.live is None
        for record in journal.recent(_RECALLED):
            if isinstance(record.event, Observed):
                self.rules.note(record.whole_plot, record.event.environment)

    def soak(self) -> None:
        """Bring the next point's whole plot to temperature, and give it its identity.

        Raises:
            TemperaturesNotSettled: a temperature did not settle in time, or somebody else has set a chamber.

        """
        point = self._queue.peek()
        assert point is not None
        assert point.whole_plot is not None
        fold = self._journal.fold
        targets = self.rules.targets(point)
        # Once a whole plot: after a resume its chambers have left already, and may be near their setpoints again.
        if targets and fold.left_for != point.whole_plot:
            self._leave(point)
        for chamber, target in targets.items():
            self._do.chambers.set(chamber, target)
        doing = "soaking for" if targets else "setting"
        self._journal.message = f"{doing} whole plot {point.whole_plot} of {self._run_list.whole_plots}"
        self._go(point)

        def watch(values: Mapping[str, float]) -> None:
            shown = ", ".join(
                f"{chamber.removesuffix('_chamber')} {values[chamber]:.1f} of {target:g}"
                for chamber, target in targets.items()
            )
            self._journal.detail = f"{shown} degC"
            self.rules.check_thermometers(values)
            disturbed = self.rules.check_chambers(point, self._do.chambers.seen)
            if disturbed:
                raise TemperaturesNotSettled(disturbed, {})

        thermometers, criteria = self.rules.thermometers, self.rules.criteria(point)
        evidence = self._do.until_soaked(criteria, self._soak.poll_s, thermometers, watch) if criteria else {}
        evidence |= self._settle(point)
        arrivals = self._do.arrivals
        self._journal.message = self._journal.detail = ""
        self._do.chambers.take_unwatched_s()  # readings before the end of the soak do not matter
        self._journal.begin_whole_plot(
            WholePlotBegan(
                planned=point.whole_plot,
                setpoints_degC=targets,
                settling=evidence,
                settings=self._others(point) or EMPTY,
                approach={f.axis: (came.side, came.start) for f in self._held.factors if (came := arrivals.get(f.axis))}
                or EMPTY,
            )
        )
        self.watched = True

    def _others(self, point: Point) -> dict[str, float]:
        """Settings of a whole plot that are no temperatures, by factor."""
        soaked = {one.factor for one in self.rules.soaked}
        setting = self._run_list.setting(point)
        return {f.name: setting[f.name] for f in self._run_list.hard if f.name not in soaked}

    def _go(self, point: Point) -> None:
        """Set what instruments hold for a point's whole plot. Raises `TemperaturesNotSettled`."""
        if not self._held.factors:
            return
        timeout_s = max(self._held.settled(f.axis).timeout_s for f in self._held.factors)
        try:
            self._do.go(self._held.legs(point, self._do.positions()), self._poll_s, timeout_s)
        except NotSettled as error:
            raise TemperaturesNotSettled(str(error), error.evidence, error.too_late) from error

    def _settle(self, point: Point) -> dict[str, Any]:
        """Wait until that has settled; the evidence. Raises `TemperaturesNotSettled`."""
        if not self._held.factors:
            return {}
        try:
            evidence = self._do.settle(self._held.targets(point), self._held.settled, self._poll_s)
        except NotSettled as error:
            raise TemperaturesNotSettled(str(error), error.evidence, error.too_late) from error
        astray = self._held.astray(point, self._do.arrivals)
        if astray:
            raise TemperaturesNotSettled(astray, evidence)
        return evidence

    def _leave(self, point: Point) -> None:
        """Make sure that temperatures change for a whole plot: a chamber already at its setpoint leaves it first."""
        if not self.rules.left(point, self._do.chambers.read()):
            away = self.rules.renewal(point)
            self._journal.write(Renewing(setpoints_degC=away))
            self._journal.message = f"leaving temperatures that stand, for whole plot {point.whole_plot}"
            for chamber, target in away.items():
                self._do.chambers.set(chamber, target)
            limit = self._clock.now() + self._soak.timeout_s
            while not self.rules.left(point, self._do.chambers.read()):
                if self._clock.now() > limit:
                    raise TemperaturesNotSettled("no chamber left the temperature it was at", {}, tuple(away))
                self._wait(self._soak.poll_s)
        assert point.whole_plot is not None
        self._journal.write(TemperaturesLeft(planned=point.whole_plot))

    def look(self) -> None:
        """While a person is waited for: look whether the open whole plot stands.

        As long as it is seen to stand, at most `continue_gap_s` apart, it is not left alone.
        """
        fold, now_s = self._journal.fold, self._journal.elapsed()
        if not self.watched or fold.whole_plot is None or fold.planned is None or now_s - self._looked_s < _LOOK_S:
            return
        self._looked_s = now_s
        point, as_found = self._run_list.points[self.rules.span(fold.planned)[0]], self._do.readback()
        alone_s = min(now_s - (fold.worked_s or 0.0), now_s - self._seen_s)
        away = self.rules.out_of_place(point, as_found["chambers"]) or self._moved(point, as_found)
        if not away and alone_s <= self.rules.continue_gap_s:
            self._seen_s, self._away = now_s, ""
        self._away = self._away or away

    def check_while_working(self, point: Point) -> None:
        """Check a whole plot after a fault: it is lost if an instrument lost power, or after too long a time alone.

        Called before instruments are set up again, because that removes the evidence of a loss of power.

        Raises:
            TemperatureLeft: the whole plot was lost.

        """
        unwatched_s = self._do.chambers.take_unwatched_s()
        why = self.lost_meanwhile(point, unwatched_s, restarted=self._do.restarted(), as_found=self._do.readback())
        if why:
            self.lose(why)

    def goes_on(self, point: Point) -> bool:
        """Whether the open whole plot of `point` goes on while axes are homed again.

        It is given up if an angle of the head is its setting, which homing moves, or if it does not stand any more.
        Called before instruments are set up again.
        """
        fold = self._journal.fold
        if fold.whole_plot is None or fold.planned != point.whole_plot:
            return False
        unwatched_s, found = self._do.chambers.take_unwatched_s(), self._do.readback()
        why = self.lost_meanwhile(point, unwatched_s, restarted=self._do.restarted(), as_found=found)
        if not why and self._held.by_head:
            why = "the head that holds its angle is homed again"
        if why:
            self.give_up(why)
        return not why

    def lost_meanwhile(
        self,
        point: Point,
        idle_s: float,
        *,
        restarted: Sequence[str],
        as_found: Mapping[str, Any],
        certain: bool = True,
    ) -> str:
        """Why the whole plot of `point` may not continue; "" if it may (`WholePlots.lost_meanwhile`)."""
        if self.watched:
            idle_s, gap_s = min(idle_s, self._journal.elapsed() - self._seen_s), self.rules.continue_gap_s
            if certain and self._away and idle_s > gap_s:
                longer = f"{idle_s / 60:.0f} min, longer than continue_gap_s = {gap_s:g} s"
                return f"it did not stand for {longer} (seen: {self._away})"
        why = self.rules.lost_meanwhile(
            point, idle_s, certain=certain, watched=self.watched, restarted=restarted, as_found=as_found
        )
        if why and restarted and self._anew and not self.watched:
            return f"the bench of a dry run begins anew in each session: {why}"
        return why or self._moved(point, as_found)

    def _moved(self, point: Point, as_found: Mapping[str, Any]) -> str:
        """Which held setting does not stand any more, and where it is; "" if all do."""
        axes = ((f, as_found["axes"][f.axis]) for f in self._held.factors)
        return self._held.out_of_place(
            point, {f.axis: (one[f.name], one["enabled"] and one["homed"]) for f, one in axes}
        )

    def lost_now(
        self,
        point: Point,
        chambers: Mapping[str, Any],
        temperatures: Mapping[str, Channel],
        axes: Mapping[str, AxisReading],
    ) -> str:
        """Why the last readings do not belong to the open whole plot; "" if they do."""
        why = self.rules.lost_now(point, chambers, temperatures) or self._held.out_of_place(
            point, {axis: (one.value, one.enabled and one.homed) for axis, one in axes.items()}
        )
        if why:
            return why
        restarted = self._do.restarted() if self.rules.soaked or self._held.factors else []
        if restarted:
            return without_power(restarted)
        self.watched = True
        self.rules.note(self._journal.fold.whole_plot, chambers)
        return ""

    def lose(self, why: str) -> NoReturn:
        """Give up the open whole plot because its temperatures were lost. Raises `TemperatureLeft`, for the
        policies.
        """
        identity = self._journal.fold.whole_plot
        planned, kept = self.give_up(why)
        times = self._lost[planned]
        again = f", lost {times} times in this session" if times > 1 else ""
        look_at = "the chambers" if self.rules.soaked else "what sets it"
        raise TemperatureLeft(
            f"whole plot {identity} (number {planned} of the design{again}) was lost because {why}; {kept}",
            f". Look at {look_at}, then resume",
        )

    def give_up(self, why: str) -> tuple[int, str]:
        """Give up the open whole plot: its accepted points are kept, and it is measured again under a new identity.

        Points accepted while a chamber repeated its reading are in doubt; tables leave them out.

        Returns:
            The planned whole plot, and a sentence about its observed points.

        """
        fold = self._journal.fold
        planned = fold.planned
        assert planned is not None
        first, count = self.rules.span(planned)
        kept = len(fold.accepted.intersection(range(first, first + count)))
        self._journal.take_up(None)  # the record is about the whole plot, and names no point
        lost = WholePlotLost(reason=why, planned=planned, first=first, count=count, kept=kept)
        becomes = f"readings kept: {kept}"
        if self.rules.doubted_s:
            since = round(self._journal.elapsed() - self.rules.doubted_s, 3)
            last = [r for r in self._journal.recent(count) if r.whole_plot == fold.whole_plot]
            doubted = sum(r.elapsed_s >= since for r in last)
            becomes = f"readings kept: {kept - doubted}; in doubt and left out: {doubted}"
            reason = f"{why} ({doubted} of its readings are in doubt and left out)"
            lost = replace(lost, reason=reason, kept=kept - doubted, doubted_s=since, doubted=doubted)
            self.rules.doubted_s = 0.0
        self._journal.write(lost)
        self._settings.forget()
        self._queue.refill()  # after the record, by which points of the whole plot are to be observed again
        self._away = ""
        self._lost[planned] += 1
        return planned, becomes
