"""Actions at a point: approach, settling, readings, record. Each state has one handler.

Every handler returns the next trigger. Repeats of too noisy readings are here; other failures are raised, and retried
by `rig.engine.deciding`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from statistics import median
from typing import Any

from rig.bench.scatter_limits import most_scatter, noisiest, without_limit
from rig.engine.actions import BenchActions
from rig.engine.by_hand.asking import ByHand
from rig.engine.by_hand.to_read import ReadByHand
from rig.engine.by_hand.to_set import SetByHand
from rig.engine.early_warning import EarlyWarnings
from rig.engine.failure_counts import Policies
from rig.engine.fault_classes import (
    ChannelFailed,
    DoubtfulReadings,
    FrozenReading,
    NotSettled,
    OverloadedError,
    ReferenceDisagrees,
    TemperatureLeft,
    TooNoisy,
)
from rig.engine.holes import HoleInTime
from rig.engine.journal import Journal, PointInHand
from rig.engine.liveness import Liveness
from rig.engine.measuring import Observation
from rig.engine.motion import NEARLY, Leg, plan_legs, recovery_legs
from rig.engine.prepared_environment import commanded
from rig.engine.queue import PointQueue
from rig.engine.soaking import Soaking
from rig.engine.steering import Steering, overshot
from rig.engine.too_late import LEAST_MOVE_S
from rig.engine.wellness import Wellness
from rig.instruments.opening import Bench
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file.events.bench import Warned
from rig.run_file.events.event import EMPTY
from rig.run_file.events.points import ACCEPTED, CONTRADICTORY, MISSING, REJECTED, Observed, readings_of
from rig.run_file.events.sessions import Held
from rig.run_file.state.lost_digits import LostDigits, lost_digit
from rig.run_file.state.own_scatter import KEPT, OwnScatter

_STRAY_SDS = 6.0
"""Robust standard deviations beyond which a readback is no noise: a noisy reference is not a stray one."""
_SDS_OF_MAD = 1.4826
"""Standard deviation of a normal distribution, in median absolute deviations."""


class AtPoint:
    """Handlers of the states that work on a point.

    Args:
        bench: opened instruments.
        run_list: every point of the run.
        conduct: how points are approached and read.
        do: actions on the bench.
        journal: where it is recorded.
        queue: points still to be observed.
        soaking: soaks whole plots; None if no factor is hard to change.
        set_up: sets the instruments as the bench declares, when that is due.
        warnings: watches the sensors; None if no early warnings are wanted.
        policies: decide which doubtful readings are accepted with a flag.
        check_time: raises `HoleInTime` after a gap in time.
        by_hand: steps that a person does between points.
        settings: factors that a person sets.
        typed: readings that a person takes.
        steering: brings quantities to levels that their standards read.

    Attributes:
        move_timeout_s: longest permitted duration of a move, seconds.

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
        by_hand: ByHand,
        settings: SetByHand,
        typed: ReadByHand,
        steering: Steering,
    ) -> None:
        self._settings, self._typed = settings, typed
        self._check_time, self._by_hand = check_time, by_hand
        self._bench, self._run_list, self._conduct = bench, run_list, conduct
        self._do, self._journal, self._queue = do, journal, queue
        self._soaking = soaking
        self._set_up, self._policies, self._warnings = set_up, policies, warnings
        self._axes = frozenset(do.axis_names)
        moved = enumerate(run_list.factors)
        self._moved = [(place, f.axis) for place, f in moved if not f.hard and f.axis in self._axes]
        self._references = tuple(f for f in run_list.easy if not f.stays)
        self._standards = [f for f in run_list.factors if f.name in bench.references]
        self._most_scatter = most_scatter(conduct, bench.config)
        self._steering = steering
        self._own_scatter = OwnScatter(without_limit(conduct, bench.config), run_list.largest())
        self._lost_digits = LostDigits(run_list, bench.config.typed)
        for record in journal.recent(KEPT):
            if isinstance(record.event, Observed) and record.run_index is not None:
                self._own_scatter.recall(record.run_index, record.event)
                self._lost_digits.recall(record.run_index, record.event)
        self._well = Wellness(do, journal)
        self._poll_s = conduct.poll_s
        read_by = (*bench.sensors.items(), *bench.references.items())
        readers = {name: reader for name, (reader, _) in read_by if not bench.coarse(reader)}
        readers = {name: reader for name, reader in readers.items() if name not in bench.config.typed}
        last = journal.last_read()
        at, read = (None, {}) if last is None else (run_list.points[last[0]], last[1])
        places = {f.name: place for place, f in enumerate(run_list.factors) if f.name in bench.references}
        self._liveness = Liveness(readers, at, read, places, journal.hung())
        self.move_timeout_s = max(LEAST_MOVE_S, conduct.settle.timeout_s)

    def recovering(self) -> str:
        """Plan the way back to the current point, or to the next one."""
        elsewhere = None if self._journal.at else self._advance()
        if elsewhere is not None:
            return elsewhere
        at = self._at
        if self._soaking is not None:
            self._soaking.check_while_working(at.point)
        elif not commanded(self._conduct.environment, self._do.chambers.read()):
            return "prepare"  # somebody has set or switched off a chamber
        self._set_up()  # after the check, which reads the marks that setting up renews
        self._journal.start_timing()
        at.legs = recovery_legs(self._run_list.factors, at.point, self._before(at.point), self._axes)
        at.repeats = 0
        return "move"

    def _legs(self, point: Point, positions: Mapping[str, float]) -> list[Leg]:
        return plan_legs(
            self._run_list.factors,
            point,
            positions,
            self._do.arrivals,
            lambda axis: self._conduct.settled(axis).band,
        )

    def _before(self, point: Point) -> Point | None:
        """The previous point of the run list, if it is in the same whole plot."""
        before = self._run_list.points[point.index - 1] if point.index else None
        return before if before is not None and before.whole_plot == point.whole_plot else None

    def _advance(self) -> str | None:
        """Take the next point. Returns a trigger if there is none, or if a step by hand or a soak comes first."""
        following = self._queue.peek()
        if following is None:
            self._journal.take_up(None)
            return "park"
        if self._by_hand.due(following):
            self._journal.take_up(None)
            return self._by_hand.ask()
        if self._soaking is not None and following.whole_plot != self._journal.fold.planned:
            return "prepare"
        if self._by_hand.unset(following):
            self._journal.take_up(None)
            return self._by_hand.ask_to_set(following)
        self._journal.take_up(self._queue.pop())
        return None

    @property
    def _at(self) -> PointInHand:
        """The current point, in states that have one."""
        assert self._journal.at is not None
        return self._journal.at

    def moving(self) -> str:
        """Go there."""
        self._do.go(self._at.legs, self._poll_s, self.move_timeout_s)
        return "settle"

    def settling(self) -> str:
        """Wait until every axis has settled."""
        at = self._at
        targets = self._targets(at.point)
        if not targets:  # a person has set everything
            self._do.rest(self._conduct.settle.dwell_s)
            return "measure"
        at.settling = self._do.settle(targets, self._conduct.settled, self._poll_s)
        at.steered = self._steering.bring(at.point, self._run_list.factors, targets)
        return "measure"

    def _targets(self, point: Point) -> dict[str, float]:
        """Position of every axis at a point."""
        return {axis: point.setpoints[place] for place, axis in self._moved}

    def measuring(self) -> str:
        """Read every channel, those that a person reads first. Overloads and excessive noise are rejected here."""
        at, settings = self._at, self._conduct
        if self._by_hand.unread(at.point):
            return self._by_hand.ask_to_read(at.point)
        apart = self._typed.hand_over(at.point)
        self._well.ask(at)  # before and after the readings: what is set wrongly at neither end was right between
        began = self._journal.elapsed()
        self._liveness.begin()
        observation = self._do.sweeps.measure(settings.readings, self._poll_s, self._references)
        observation.references = {**self._settings.stated(), **observation.references}
        at.measured_s = (began, self._journal.elapsed())
        at.observation = observation
        observation.flags += overshot(at.steered)
        self._well.ask(at, observation)
        overloaded = observation.overloaded()
        if overloaded:  # first: no mean or scatter of an overload is a number
            self._journal.write(Observed(verdict=REJECTED, **observation.as_json()))
            raise OverloadedError(f"{', '.join(overloaded)} out of range at point {at.point.index}")
        self._check_channels(observation)
        self._check_alive(observation)
        self._check_references(observation)
        self._check_standards(observation)
        if apart:
            try:
                words = f"no two of three readings of {', '.join(apart)} agree at point {at.point.index}"
                self._flag("noisy", "noisy", TooNoisy(words))
            except TooNoisy:
                self._typed.begin_anew(apart)
                raise
        sds = {name: c.sd for name, c in (*observation.outputs.items(), *observation.references.items())}
        name = noisiest(sds, self._most_scatter)
        if name is not None and sds[name] > self._most_scatter[name].sd:
            most = self._most_scatter[name]
            noise = f"{name} scatters by {most.told(sds[name])} at point {at.point.index}, more than {most.most}"
            return self._again("noisy", name, noise)
        readings = observation.every_reading
        found = self._own_scatter.contradiction(readings, self._read_before(at))
        found = found or self._lost_digits.contradiction(at.point.index, readings)
        if found is not None:
            return self._again(CONTRADICTORY, found.name, f"{found.words}, at point {at.point.index}")
        return "record"

    def _read_before(self, at: PointInHand) -> list[dict[str, Sequence[float]]] | None:
        """Readings at this point that were not accepted, by column; None if readings are not taken again."""
        return readings_of(at.rejected) if self._conduct.repeats else None

    def _again(self, flag: str, name: str, words: str) -> str:
        """Read again, or accept with a flag if that was done often enough; a policy may say otherwise."""
        at = self._at
        assert at.observation is not None
        if at.repeats < self._conduct.repeats:
            at.repeats += 1
            at.rejected.append({flag: name, **at.observation.as_json()})
            return "repeat"
        self._flag(flag, "noisy", TooNoisy(words))
        return "record"

    def _check_channels(self, observation: Observation) -> None:
        """Accept outputs without a reading, with a flag and the reason, or raise, as the policies say."""
        at = self._at
        if not observation.missing:
            return
        if not self._policies.accepts("channel", at.place):
            told = "; ".join(f"{name}: {why}" for name, why in observation.missing.items())
            error = ChannelFailed(f"no reading at point {at.point.index}", 0, told)
            error.evidence = {"readings": observation.readings}
            raise error
        observation.flags.append(MISSING)

    def _check_alive(self, observation: Observation) -> None:
        """Detect a meter or sensor that hangs, or an old reply: the reading repeats to the last digit."""
        point = self._at.point
        hanging = self._liveness.hanging(point, observation, self._do.sweeps.take_in_passing())
        if hanging:
            self._well.doubt_repeated(hanging, observation.every_reading)
            words = f"{', '.join(hanging)} at point {point.index} hangs: the same reading to the last digit"
            self._flag("frozen", "frozen", FrozenReading(f"{words}, again and again"))

    def _check_references(self, observation: Observation) -> None:
        """Check that the reference was steady during the readings, so that no outlier enters its mean.

        The mean must be in the band. No readback may be further off than the band and the scatter of readbacks.
        """
        if not self._references:
            return
        at = self._at
        targets = self._targets(at.point)
        for factor in self._references:
            band = self._conduct.settled(factor.axis).band
            channel, target = observation.references[factor.name], targets[factor.axis]
            # Median and MAD: the stray readback that is looked for must not widen its own limit.
            middle = median(channel.readings)
            scatter = _SDS_OF_MAD * median(abs(r - middle) for r in channel.readings)
            worst = max(channel.readings, key=lambda r: abs(r - target))
            if abs(channel.mean - target) > band or abs(worst - target) > max(band, _STRAY_SDS * scatter):
                words = f"{factor.axis} read {worst:g} while it was measured, not within {band:g} of {target:g}"
                raise NotSettled(words, at.settling)

    def _check_standards(self, observation: Observation) -> None:
        """Check the readings of reference standards: a mean that is far from the setpoint is one of the two wrong."""
        if not self._standards:
            return
        setting = self._run_list.setting(self._at.point)
        for factor in self._standards:
            found, most = observation.references[factor.name].mean, self._conduct.tolerances.get(factor.name)
            target, unit = setting[factor.name], spelled(unit_of(factor.name))
            if most is None:
                apart = "as if a first digit were lost" if lost_digit(found, target) else ""
            else:
                far = f"more than {most:g} apart; look at the standard's formula and wiring, and at what sets it"
                apart = "" if abs(found - target) <= most else far
            if apart:
                words = (
                    f"the reference of {factor.axis} reads {found:.6g} {unit}, and it was set to {target:g}: {apart}"
                )
                self._flag("reference", "reference", ReferenceDisagrees(words))
                return

    def _flag(self, flag: str, fault: str, error: DoubtfulReadings) -> None:
        """Accept a doubtful reading with a flag or raise its error, as the policies say."""
        at = self._at
        assert at.observation is not None
        if not self._policies.accepts(fault, at.place):
            error.evidence = {"readings": at.observation.readings}
            raise error
        at.observation.flags.append(flag)

    def recording(self) -> str:
        """Make the observation durable if nothing was disturbed during it, and take the next point."""
        at = self._at
        assert at.observation is not None
        after = self._do.axes()  # read anew: only a look after the readings shows that nothing moved during them
        self._do.check_control(after)
        positions = {axis: reading.value for axis, reading in after.items()}
        self._assert_undisturbed(at, positions)
        chambers = self._do.chambers.read()
        self._check_environment(chambers)
        observed = Observed(
            verdict=ACCEPTED,
            approach={axis: (a.side, a.start) for axis, a in self._do.arrivals.items()} | self._settings.approach,
            readback={reading.quantity: reading.value for reading in after.values()} | self._settings.readback,
            settling=at.settling,
            moved=self._do.moves_at(self._journal.elapsed()),
            measured_s=at.measured_s,
            steered=at.steered or EMPTY,
            environment=chambers,
            **at.observation.as_json(),
            rejected=at.rejected or EMPTY,
        )
        try:
            self._check_time()
        except HoleInTime as hole:  # part of the readings is from a time about which nothing is known
            self._journal.write(replace(observed, verdict=REJECTED, hole_s=hole.hole_s))
            raise
        if self._soaking is not None:
            why = self._soaking.lost_now(at.point, chambers, at.observation.temperatures, after)
            if why:  # one commit: after a kill between the two records the whole plot would go on
                self._journal.write(replace(observed, verdict=REJECTED, lost=why), commit=False)
                self._soaking.lose(why)
        contradictions = self._contradictions(at)
        later = [*contradictions, *self._well.learned()]
        self._journal.write(observed, commit=not later)
        for number, event in enumerate(later, 1):  # one commit: a kill in between would lose them
            self._journal.write(event, commit=number == len(later))
        self._own_scatter.recall(at.point.index, observed)
        self._lost_digits.recall(at.point.index, observed)
        self._typed.observed(at.point, observed.every_reading)
        self._journal.point_observed()
        if (self._warned(at.point, observed) or contradictions) and self._conduct.warnings.hold:
            self._do.stop_motion()
            self._journal.write(Held(why="a warning, and the procedure asks to hold at one"))
            self._journal.take_up(None)
            return "hold"
        elsewhere = self._advance()
        if elsewhere is not None:
            return elsewhere
        self._at.legs = self._legs(self._at.point, positions)
        return "move"

    def _contradictions(self, at: PointInHand) -> list[Warned]:
        """Warnings of readings that contradict one another, here and at the first points, now that there are others.

        Of several observations lately only the first is told.
        """
        assert at.observation is not None
        own, lost, readings, told = self._own_scatter, self._lost_digits, at.observation.every_reading, []
        if CONTRADICTORY in at.observation.flags and not own.doubted:
            one = own.contradiction(readings, self._read_before(at)) or lost.contradiction(at.point.index, readings)
            told += [] if one is None else [(one, f"{one.words}, at point {at.point.index}")]
        told += [(one, f"point {one.point}: {one.words}") for one in lost.earlier(at.point.index, readings)]
        told += [(one, f"{one.words}, at point {one.point}, which was one of the first") for one in own.first(readings)]
        advice = "readings that contradict one another; look at the wiring and the meter"
        return [Warned(CONTRADICTORY, one.name, f"{words}: {advice}") for one, words in told]

    def _warned(self, point: Point, observed: Observed) -> bool:
        """Whether the observation caused a warning; each warning is recorded."""
        if self._warnings is None:
            return False
        found = self._warnings.add(point, self._journal.fold.whole_plot, observed.body())
        for warning in found:
            self._journal.write(warning)
        return bool(found)

    def _check_environment(self, chambers: Mapping[str, Any]) -> None:
        """Check that the requested environment still holds; whole plots have stricter rules of their own."""
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
        """Check that the point was approached as planned and not left during the readings."""
        for factor, target, side in zip(self._run_list.factors, at.point.setpoints, at.point.sides, strict=True):
            if factor.hard or factor.axis not in self._axes:
                continue
            arrival = self._do.arrivals.get(factor.axis)
            if side and (arrival is None or arrival.side != side):
                raise NotSettled(f"{factor.axis} did not arrive from its planned side", at.settling)
            if arrival and side and side * (target - arrival.start) < NEARLY * factor.overtravel:
                near = f"{factor.axis} arrived from {arrival.start:g}, nearer than its overtravel"
                raise NotSettled(f"{near}: did it slip?", at.settling)
            if abs(after[factor.axis] - target) > self._conduct.settled(factor.axis).band:
                raise NotSettled(f"{factor.axis} left its band while it was measured", at.settling)
