"""What is done at a point: the way there, settling, readings, the record. One handler a state.

Every handler answers with the trigger that follows. What goes wrong is raised; the sequencer decides about it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from statistics import median
from typing import Any

from procedures.conduct import Conduct
from procedures.run_list import Point, RunList
from rig.bench import Bench
from rig.engine.actions import BenchActions
from rig.engine.early_warning import EarlyWarnings
from rig.engine.fault_classes import FrozenReading, NotSettled, OverloadedError, TemperatureLeft, TooNoisy
from rig.engine.holes import HoleInTime
from rig.engine.journal import Journal, PointInHand
from rig.engine.liveness import Liveness
from rig.engine.measuring import Observation
from rig.engine.motion import plan_legs, recovery_legs
from rig.engine.policies import Policies
from rig.engine.queue import PointQueue
from rig.engine.soaking import Soaking
from rig.run_file.events.event import EMPTY
from rig.run_file.events.points import ACCEPTED, REJECTED, Observed
from rig.run_file.events.sessions import Held

_MOVE_TIMEOUT_S = 600.0
_NEARLY = 0.9
"""Of its overtravel an axis must have come at least: where it turned it may have stood a little short of it."""
_STRAY_SDS = 6.0
_SDS_OF_MAD = 1.4826


class AtPoint:
    """Handlers of the states that have a point in hand.

    Args:
        bench: opened instruments.
        run_list: every point of the run.
        conduct: how points are approached and read.
        do: actions on the bench.
        journal: where it is written down.
        queue: points still to be observed.
        soaking: whole plots, None where nothing is hard to change.
        set_up: brings the instruments' settings to what the bench declares, where that is due.
        warnings: watches over the sensors, None where that is not wanted.
        policies: say which doubtful readings are accepted, with a flag.
        check_time: raises `HoleInTime` if there was one.

    Attributes:
        move_timeout_s: how long a move may take.

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
        soaking: Soaking | None,
        set_up: Callable[[], None],
        warnings: EarlyWarnings | None,
        policies: Policies,
        check_time: Callable[[], None],
    ) -> None:
        self._check_time = check_time
        self._bench, self._run_list, self._conduct = bench, run_list, conduct
        self._do, self._journal, self._queue = do, journal, queue
        self._soaking = soaking
        self._set_up, self._policies, self._warnings = set_up, policies, warnings
        self._references = tuple(f for f in run_list.easy if not f.stays)
        self._settle = conduct.settle
        self._poll_s = conduct.poll_s
        readers = {name: reader for name, (reader, _) in bench.sensors.items()}
        last = journal.last_read()
        at, read = (None, {}) if last is None else (run_list.points[last[0]], last[1])
        self._liveness = Liveness(readers, at, read)
        self.move_timeout_s = max(_MOVE_TIMEOUT_S, self._settle.timeout_s)

    def recovering(self) -> str:
        """Plan the way back to the point in hand, or to the next one."""
        elsewhere = None if self._journal.at else self._advance()
        if elsewhere is not None:
            return elsewhere
        at = self._at
        if self._soaking is not None:
            self._soaking.check_while_working(at.point)
        self._set_up()
        self._journal.start_timing()
        at.legs = recovery_legs(self._run_list.factors, at.point, self._before(at.point))
        at.repeats = 0
        return "move"

    def _before(self, point: Point) -> Point | None:
        """The point before it in the run list, in the same whole plot."""
        before = self._run_list.points[point.index - 1] if point.index else None
        return before if before is not None and before.whole_plot == point.whole_plot else None

    def _advance(self) -> str | None:
        """Take up the next point; the trigger to go on with instead, where there is none or it must be soaked for."""
        following = self._queue.peek()
        if following is None:
            self._journal.take_up(None)
            return "park"
        if self._soaking is not None and following.whole_plot != self._journal.fold.planned:
            return "prepare"
        self._journal.take_up(self._queue.pop())
        return None

    @property
    def _at(self) -> PointInHand:
        """The point in hand, in states that have one."""
        assert self._journal.at is not None
        return self._journal.at

    def moving(self) -> str:
        """Go there."""
        self._do.go(self._at.legs, self._poll_s, self.move_timeout_s)
        return "settle"

    def settling(self) -> str:
        """Wait until every axis has settled."""
        at = self._at
        at.settling = self._do.settle(self._targets(at.point), self._settle, self._poll_s)
        return "measure"

    def _targets(self, point: Point) -> dict[str, float]:
        """Where a point wants the axes."""
        factors = zip(self._run_list.factors, point.setpoints, strict=True)
        return {f.axis: setpoint for f, setpoint in factors if not f.hard}

    def measuring(self) -> str:
        """Read every channel; overloads and noise are rejected here."""
        at, settings = self._at, self._conduct
        began = self._journal.elapsed()
        observation = self._do.measure(settings.readings, self._poll_s, self._references)
        at.measured_s = (began, self._journal.elapsed())
        at.observation = observation
        overloaded = observation.overloaded()
        if overloaded:
            self._journal.write(Observed(verdict=REJECTED, **observation.as_json()))
            raise OverloadedError(f"{', '.join(overloaded)} out of range at point {at.point.index}")
        self._check_alive(observation)
        self._check_references(observation)
        name, sd_V = observation.noisiest(self._bench.scales)
        most = self._conduct.max_sd_V
        if most is not None and sd_V > most:
            if at.repeats < settings.repeats:
                at.repeats += 1
                at.rejected.append({"noisy": name, **observation.as_json()})
                return "repeat"
            noise = f"{name} scatters by {sd_V:.2g} V at point {at.point.index}"
            self._flag("noisy", "noisy", TooNoisy(f"{noise}, more than {most:g} V"))
        return "record"

    def _check_alive(self, observation: Observation) -> None:
        """A meter or a sensor that hangs, or a reply that is old, repeats itself to the last digit."""
        point = self._at.point
        hanging = self._liveness.hanging(point, observation, self._do.take_in_passing())
        if hanging:
            words = f"{', '.join(hanging)} at point {point.index} hangs: the same reading to the last digit"
            self._flag("frozen", "frozen", FrozenReading(f"{words}, again and again"))

    def _check_references(self, observation: Observation) -> None:
        """What sensors are calibrated against stood while it was read: no stray readback goes into its mean.

        The mean is to be in the band, and no readback further off than that and than readbacks scatter.
        """
        at, band = self._at, self._settle.band
        targets = self._targets(at.point)
        for factor in self._references:
            channel, target = observation.references[factor.name], targets[factor.axis]
            middle = median(channel.readings)
            scatter = _SDS_OF_MAD * median(abs(r - middle) for r in channel.readings)
            worst = max(channel.readings, key=lambda r: abs(r - target))
            if abs(channel.mean - target) > band or abs(worst - target) > max(band, _STRAY_SDS * scatter):
                words = f"{factor.axis} read {worst:g} while it was measured, not within {band:g} of {target:g}"
                raise NotSettled(words, at.settling)

    def _flag(self, flag: str, fault: str, error: Exception) -> None:
        """Accept a doubtful reading with a flag, or raise what is doubtful about it: the policies say which."""
        at = self._at
        assert at.observation is not None
        if not self._policies.accepts(fault, at.place):
            raise error
        at.observation.flags.append(flag)

    def recording(self) -> str:
        """Make the observation durable, if nothing was disturbed meanwhile, and take up the next point."""
        at = self._at
        assert at.observation is not None
        after = self._do.axes()
        positions = {axis: reading.value for axis, reading in after.items()}
        self._assert_undisturbed(at, positions)
        chambers = self._do.environment()
        self._check_environment(chambers)
        observed = Observed(
            verdict=ACCEPTED,
            approach={axis: (a.side, a.start) for axis, a in self._do.arrivals.items()},
            readback={reading.quantity: reading.value for reading in after.values()},
            settling=at.settling,
            measured_s=at.measured_s,
            environment=chambers,
            **at.observation.as_json(),
            rejected=at.rejected or EMPTY,
        )
        try:
            self._check_time()
        except HoleInTime as hole:  # read over a time of which nothing is known
            self._journal.write(replace(observed, verdict=REJECTED, hole_s=hole.hole_s))
            raise
        if self._soaking is not None:
            why = self._soaking.lost_now(at.point, chambers, at.observation.temperatures)
            if why:  # one commit: a kill between the two must not let the whole plot go on
                self._journal.write(replace(observed, verdict=REJECTED, lost=why), commit=False)
                self._soaking.lose(why)
        self._journal.write(observed)
        self._journal.point_observed()
        if self._warned(at.point, observed) and self._conduct.warnings.hold:
            self._do.stop_motion()
            self._journal.write(Held(why="a warning, and the procedure asks to hold at one"))
            self._journal.take_up(None)
            return "hold"
        elsewhere = self._advance()
        if elsewhere is not None:
            return elsewhere
        band = self._settle.band
        self._at.legs = plan_legs(self._run_list.factors, self._at.point, positions, self._do.arrivals, band)
        return "move"

    def _warned(self, point: Point, observed: Observed) -> bool:
        """Whether the observation gave reason for a warning; each is written down."""
        if self._warnings is None:
            return False
        found = self._warnings.add(point, self._journal.fold.whole_plot, observed.body())
        for warning in found:
            self._journal.write(warning)
        return bool(found)

    def _check_environment(self, chambers: Mapping[str, Any]) -> None:
        """An environment that was asked for still stands; of whole plots their own rules say more."""
        wanted = self._conduct.environment
        if wanted is None:
            return
        for name, state in chambers.items():
            degC = state["temperature_degC"]
            if abs(degC - wanted.setpoint_degC) > wanted.tolerance_degC:
                words = (
                    f"{name} is at {degC:.2f} degC, not within {wanted.tolerance_degC:g} of {wanted.setpoint_degC:g}"
                )
                self._flag("temperature", "temperature_left", TemperatureLeft(words))
                return

    def _assert_undisturbed(self, at: PointInHand, after: Mapping[str, float]) -> None:
        """An observation counts only where it was planned, reached as planned, and not left meanwhile."""
        for factor, target, side in zip(self._run_list.factors, at.point.setpoints, at.point.sides, strict=True):
            if factor.hard:
                continue
            arrival = self._do.arrivals.get(factor.axis)
            if side and (arrival is None or arrival.side != side):
                raise NotSettled(f"{factor.axis} did not arrive from its planned side", at.settling)
            if arrival and side and side * (target - arrival.start) < _NEARLY * factor.overtravel:
                near = f"{factor.axis} arrived from {arrival.start:g}, nearer than its overtravel"
                raise NotSettled(f"{near}: did it slip?", at.settling)
            if abs(after[factor.axis] - target) > self._settle.band:
                raise NotSettled(f"{factor.axis} left its band while it was measured", at.settling)
