"""Soaking whole plots and giving them up: applies the rules of whole plots to the bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NoReturn

from drivers.clock import Clock
from procedures.conduct import WholePlotConduct
from procedures.run_list import Point, RunList
from rig.bench import Bench
from rig.engine.actions import BenchActions
from rig.engine.fault_classes import TemperatureLeft, TemperaturesNotSettled
from rig.engine.journal import Journal
from rig.engine.measuring import Channel
from rig.engine.queue import PointQueue
from rig.engine.whole_plots import WholePlots, without_power
from rig.run_file.events.points import Observed, Renewing, TemperaturesLeft, WholePlotBegan, WholePlotLost

_RECALLED = 40
"""Number of observations read again when a run is resumed, to know the behaviour of the chambers."""


class Soaking:
    """Whole plots on one bench.

    Args:
        bench: opened instruments.
        run_list: every point of the run.
        conduct: soak and recovery.
        do: actions on the bench.
        journal: where it is recorded.
        queue: points still to be observed.
        clock: bench time.
        wait: waits for this number of bench seconds; may raise to interrupt.

    Attributes:
        rules: the rules of whole plots.

    Raises:
        ConfigurationError: the bench file names no chamber for a factor.

    """

    def __init__(
        self,
        *,
        bench: Bench,
        run_list: RunList,
        conduct: WholePlotConduct,
        do: BenchActions,
        journal: Journal,
        queue: PointQueue,
        clock: Clock,
        wait: Callable[[float], None],
    ) -> None:
        self.rules = WholePlots(bench, run_list, conduct)
        self._run_list, self._soak = run_list, conduct.soak
        self._do, self._journal, self._queue = do, journal, queue
        self._clock, self._wait = clock, wait
        self._lost = 0
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
        if fold.left_for != point.whole_plot:
            self._leave(point)
        targets = self.rules.targets(point)
        for chamber, target in targets.items():
            self._do.set_chamber(chamber, target)
        self._journal.message = f"soaking for whole plot {point.whole_plot} of {self._run_list.whole_plots}"

        def watch(values: Mapping[str, float]) -> None:
            shown = ", ".join(
                f"{chamber.removesuffix('_chamber')} {values[chamber]:.1f} of {target:g}"
                for chamber, target in targets.items()
            )
            self._journal.detail = f"{shown} degC"
            self.rules.check_thermometers(values)
            disturbed = self.rules.check_chambers(point, self._do.chambers_seen)
            if disturbed:
                raise TemperaturesNotSettled(disturbed, {})

        settings, thermometers = self._soak, self.rules.thermometers
        evidence = self._do.until_soaked(self.rules.criteria(point), settings.poll_s, thermometers, watch)
        self._journal.message = self._journal.detail = ""
        self._do.take_unwatched_s()  # readings before the end of the soak do not matter
        self._journal.begin_whole_plot(
            WholePlotBegan(planned=point.whole_plot, setpoints_degC=targets, settling=evidence)
        )

    def _leave(self, point: Point) -> None:
        """Make sure that temperatures change for a whole plot: a chamber already at its setpoint leaves it first."""
        if not self.rules.left(point, self._do.environment()):
            away = self.rules.renewal(point)
            self._journal.write(Renewing(setpoints_degC=away))
            self._journal.message = f"leaving temperatures that stand, for whole plot {point.whole_plot}"
            for chamber, target in away.items():
                self._do.set_chamber(chamber, target)
            limit = self._clock.now() + self._soak.timeout_s
            while not self.rules.left(point, self._do.environment()):
                if self._clock.now() > limit:
                    raise TemperaturesNotSettled("no chamber left the temperature it was at", {})
                self._wait(self._soak.poll_s)
        assert point.whole_plot is not None
        self._journal.write(TemperaturesLeft(planned=point.whole_plot))

    def check_while_working(self, point: Point) -> None:
        """Check a whole plot after a fault: it is lost if an instrument lost power, or after too long a time alone.

        Called before instruments are set up again, because that removes the evidence of a loss of power.

        Raises:
            TemperatureLeft: the whole plot was lost.

        """
        why = self.rules.lost_meanwhile(
            point,
            self._do.take_unwatched_s(),
            certain=True,
            restarted=self._do.restarted(),
            as_found=self._do.readback(),
        )
        if why:
            self.lose(why)

    def lost_now(self, point: Point, chambers: Mapping[str, Any], temperatures: Mapping[str, Channel]) -> str:
        """Why the last readings do not belong to the open whole plot; "" if they do."""
        why = self.rules.lost_now(point, chambers, temperatures)
        if why:
            return why
        restarted = self._do.restarted()
        if restarted:
            return without_power(restarted)
        self.rules.note(self._journal.fold.whole_plot, chambers)
        return ""

    def lose(self, why: str) -> NoReturn:
        """Give up the open whole plot because its temperatures were lost. Raises `TemperatureLeft`, for the
        policies.
        """
        planned, kept = self.give_up(why)
        again = f"{self._lost} times in this session, last " if self._lost > 1 else ""
        raise TemperatureLeft(
            f"whole plot {planned} was lost {again}because {why}; {kept}. Look at the chambers, then resume"
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
        self._journal.take_up(None)
        lost = WholePlotLost(reason=why, planned=planned, first=first, count=count, kept=kept)
        becomes = f"its {kept} readings are kept"
        if self.rules.doubted_s:
            since = round(self._journal.elapsed() - self.rules.doubted_s, 3)
            last = [r for r in self._journal.recent(count) if r.whole_plot == fold.whole_plot]
            doubted = sum(r.elapsed_s >= since for r in last)
            becomes = f"{kept - doubted} of its readings are kept, {doubted} are in doubt and left out"
            reason = f"{why} ({doubted} of its readings are in doubt and left out)"
            lost = replace(lost, reason=reason, kept=kept - doubted, doubted_s=since, doubted=doubted)
            self.rules.doubted_s = 0.0
        self._journal.write(lost)
        self._queue.refill()
        self._lost += 1
        return planned, becomes
