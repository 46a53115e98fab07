"""The sequencer: one flat state machine that carries out a run list, point by point, and writes the run file.

Every state has one handler, which does its work and returns the next trigger. The table of states
(`rig.engine.states`) says which triggers are permitted. Resuming is the ordinary way to run: a new run is a run
without observations.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from rig.drivers.clock import Clock
from rig.drivers.errors import DriverError
from rig.engine.actions import BenchActions
from rig.engine.at_point import AtPoint
from rig.engine.axes_of_bench import axes_of, own_limits
from rig.engine.by_hand.asking import ByHand
from rig.engine.by_hand.to_read import ReadByHand
from rig.engine.by_hand.to_set import SetByHand
from rig.engine.deciding import Deciding
from rig.engine.early_warning import EarlyWarnings
from rig.engine.failure_counts import Policies
from rig.engine.fault_classes import FAULTS, InterlockHold, TemperatureLeft
from rig.engine.guard import Guard
from rig.engine.hard_factors import held_factors
from rig.engine.holes import HoleInTime, watched
from rig.engine.interruptions import HoldRequested, Interrupted, Interruptions, StopRequested
from rig.engine.journal import Journal, PointInHand
from rig.engine.pace import Pace
from rig.engine.parking import Parking
from rig.engine.prepared_environment import PreparedEnvironment
from rig.engine.queue import PointQueue
from rig.engine.safe_state import make_safe
from rig.engine.same_instruments import compare_identities
from rig.engine.session import Outcome, Progress, Session, Signals
from rig.engine.soaking import Soaking
from rig.engine.states import AT_POINT, FINAL, Moves, State
from rig.engine.steered import Steered
from rig.engine.steering import Steering
from rig.engine.too_late import advice
from rig.engine.waiting_for_person import CannotHold, Holding, NobodyCame
from rig.engine.wellness import Wellness
from rig.errors import BenchFault, NotSafe, RigError, StorageError
from rig.instruments.opening import Bench, identities
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.fault_policies import ABORT, HOLD, RE_HOME, RE_SOAK, SKIP
from rig.procedures.plan.run_list import RunList
from rig.run_file.events.bench import (
    AsFound,
    EnvironmentSettled,
    EnvironmentStands,
    Fault,
    Homed,
    MadeSafe,
    Prepared,
    Preparing,
    Remark,
)
from rig.run_file.events.event import EMPTY
from rig.run_file.events.points import Skipped
from rig.run_file.events.sessions import Ended, Held, Interruption, Parked, Stopped
from rig.run_file.live import Requests
from rig.run_file.state.state import RunState
from rig.run_file.write.writer import RunWriter

if TYPE_CHECKING:
    from rig.procedures.plan.expected import Previous

_SLICE_S = 5.0
"""Longest wait without a look for signals and requests, bench seconds."""


class Sequencer:
    """Carries out a run.

    Args:
        bench: opened instruments.
        run: the run file, locked for writing.
        state: state of the run by its records.
        run_list: every point.
        conduct: how points are approached and read, and how faults are handled.
        clock: bench time.
        session: this start of the controller.
        signals: checked wherever the sequencer waits.
        on_progress: called with the progress at every change of state, and about once a second of bench time.
        previous: the last calibration of these sensors, for early warnings.

    """

    def __init__(
        self,
        *,
        bench: Bench,
        run: RunWriter,
        state: RunState,
        run_list: RunList,
        conduct: Conduct,
        clock: Clock,
        session: Session,
        signals: Signals,
        on_progress: Callable[[Progress], None],
        previous: Previous | None = None,
    ) -> None:
        clock = watched(clock)
        self._bench, self._path = bench, run.path
        self._run_list, self._conduct = run_list, conduct
        self._clock, self._session, self._signals = clock, session, signals
        pace = Pace(run_list, conduct, bench.config) if conduct.whole_plots else None
        self._journal = Journal(run, state, clock, session, on_progress, run_list.whole_plots, pace)
        moved = (*run_list.easy, *held_factors(bench, run_list))
        self._axes = axes_of(bench, moved, lambda axis: conduct.settled(axis).band, lambda name: conduct.near[name])
        config = bench.config
        self._guard = Guard(config.limits, config.factors, config.interlocks, clock.now)
        self._do = BenchActions(bench, self._axes, self._guard, clock, self._wait)
        self._watched = bool(bench.chambers)
        self._journal.settling, self._journal.moving = self._do.settling_now, self._do.moving_now
        requests = Requests(run.path, session.number, clock.stopwatch)
        self._settings = SetByHand(bench, run_list, conduct)
        if state.planned is not None:
            self._settings.recall(state.set_by_hand, state.planned)
        self._readings = ReadByHand(bench, run_list, conduct, self._journal)
        self._by_hand = ByHand(
            run_list,
            self._journal,
            clock,
            run.path,
            stop_motion=self._do.stop_motion,
            person=bench.person,
            hold_max_s=conduct.hold_max_s,
            settings=self._settings,
            readings=self._readings,
        )
        self._interruptions = Interruptions(signals, requests, self._journal, lambda: self.state, clock, self._by_hand)
        self._look_up = self._interruptions.look_up
        self._queue = PointQueue(run_list, state)
        self._policies = Policies(conduct, clock.now)
        self._deciding = Deciding(
            self._policies, self._journal, self._do, clock, look_up=self._look_up, recognise=self._recognise
        )
        self._soaking: Soaking | None = None
        if conduct.whole_plots is not None:
            self._soaking = Soaking(
                bench=bench,
                run_list=run_list,
                conduct=conduct,
                do=self._do,
                journal=self._journal,
                queue=self._queue,
                clock=clock,
                wait=self._wait,
                settings=self._settings,
            )
        self._point = AtPoint(
            bench=bench,
            run_list=run_list,
            conduct=conduct,
            do=self._do,
            journal=self._journal,
            queue=self._queue,
            soaking=self._soaking,
            set_up=self._set_up,
            warnings=self._early_warnings(run, state, previous),
            policies=self._policies,
            check_time=self._interruptions.check_time,
            by_hand=self._by_hand,
            settings=self._settings,
            typed=self._readings,
            steering=Steering(self._do, conduct, [one for one in self._axes.movers if isinstance(one, Steered)]),
        )
        self._well = Wellness(self._do, self._journal)
        self._standing = PreparedEnvironment(conduct, self._journal, self._queue, self._soaking)
        self._hold = Holding(
            self._by_hand,
            self._journal,
            self._do,
            self._deciding,
            self._interruptions,
            clock,
            conduct.hold_max_s,
            self._soaking.look if self._soaking is not None else lambda: None,
        )
        self._way_out = Parking(bench, self._do, self._journal, self._deciding, clock, self._set_up)
        self._poll_s = conduct.poll_s
        self._put_off = set(state.put_off)
        self._outcome: Outcome | None = None
        self._ending = ""
        self._needs_set_up = True
        self._remarked: set[tuple[str, str]] = set()
        self._began_s = 0.0
        self._home_again = self._checked = self._stands = False
        self._moves = Moves()
        self._handlers: dict[str, Callable[[], str]] = {
            State.READY: lambda: "check",
            State.CHECKING: self._checking,
            State.PREPARING: self._preparing,
            State.RECOVERING: self._point.recovering,
            State.MOVING: self._point.moving,
            State.SETTLING: self._point.settling,
            State.MEASURING: self._point.measuring,
            State.RECORDING: self._point.recording,
            State.HOLDING: self._holding,
            State.PARKING: self._parking,
        }
        missing = set(State) - FINAL - set(self._handlers)
        assert not missing, f"states without a handler: {missing}"

    @property
    def state(self) -> State:
        """The present state."""
        return self._moves.state

    @property
    def message(self) -> str:
        """The present activity; after the end, the reason for the end."""
        return self._journal.message

    def _early_warnings(self, run: RunWriter, state: RunState, previous: Previous | None) -> EarlyWarnings | None:
        if not self._conduct.warnings.enabled:
            return None
        warnings = EarlyWarnings(self._run_list, previous, self._conduct)
        if state.worked_s is not None:
            warnings.recall(run)
        return warnings

    # --- the loop -------------------------------------------------------------------------------------------

    def run(self) -> Outcome:
        """Work until done, stopped, interrupted or faulted. The bench is then safe, unless the outcome is `UNSAFE`."""
        try:
            # Taken over from the run before: from here on this session answers for what is on.
            self._stands, self._bench.stands = self._bench.stands, False
            self._journal.open()
            self._began_s = self._journal.elapsed()
            moves, journal = self._moves, self._journal
            while moves.state not in FINAL:
                trigger = self._next_trigger()
                if trigger is None:
                    break
                moves.trigger(trigger)
                journal.state = moves.state
                journal.tell()
            return self._outcome or Outcome.FAULT
        except Exception as error:
            self._unforeseen(error)  # safe state first, then the traceback
            raise
        except BaseException:
            make_safe(self._bench, self._clock)  # the process ends; nothing is recorded
            raise
        finally:
            self._journal.close()

    def _next_trigger(self) -> str | None:
        """The next trigger; None to leave the loop, for a later resume."""
        try:
            try:
                return self._handled()
            except Interrupted:
                return self._interrupted()
            except HoleInTime:
                return self._check_again()
            except HoldRequested:
                return self._begin_hold("asked for", who=self._interruptions.who)
            except InterlockHold as error:
                return self._begin_hold(str(error))
            except StopRequested:
                self._outcome = Outcome.STOPPED
                self._deciding.stop_motion()
                self._journal.write(Stopped(who=self._interruptions.who))
                return "park"
        except StorageError as error:
            return self._give_up(str(error), recorded=False)
        except (*FAULTS, RigError) as error:
            self._well.doubt_last(error)
            return self._give_up(str(error))

    def _handled(self) -> str:
        """The trigger of the state's handler, or of the fault policy if the handler failed."""
        state, at = self.state, self._journal.at
        try:
            trigger = self._handlers[state]()
        except FAULTS as error:
            return self._decide(error)  # may wait, and a wait may be interrupted
        if state is State.RECORDING and at is not None:
            self._policies.observed()
            self._deciding.done(at.place)
        elif state in (State.CHECKING, State.PREPARING, State.HOLDING):
            self._deciding.done(str(state))
        return trigger

    # --- waiting, signals, requests -------------------------------------------------------------------------------

    def _wait(self, seconds: float) -> None:
        """Wait in short slices; look for signals and requests between them."""
        clock = self._clock
        # Every poll takes the first way: one slice, and one reading of the clock that serves both tests.
        if 1e-9 < seconds <= _SLICE_S:
            now = clock.pause(seconds)
            self._look_up(now)
        else:
            now = clock.now()
            end = now + seconds
            while (left := end - now) > 1e-9:
                now = clock.pause(min(left, _SLICE_S))
                self._look_up(now)
        if clock.noted:
            self._interruptions.check_time()
        if self._watched:
            self._do.chambers.look_around(now)

    # --- handlers, one a state ------------------------------------------------------------------------------

    def _recognise(self) -> None:
        found = identities(self._bench, self._journal.fold.identities)
        compare_identities(self._journal, found, self._session.accept, self._path)

    def _checking(self) -> str:
        self._recognise()  # first: no command goes to an exchanged instrument
        found_on = self._do.stop_motion()
        # Read before anything is set up, which would remove the evidence of a loss of power.
        restarted = self._do.restarted()
        as_found = self._do.readback()
        found = AsFound(**as_found, on=tuple(found_on) or EMPTY, restarted=restarted)
        self._journal.write(found)
        self._guard.check_run_list(self._run_list, own_limits(self._bench, self._run_list))
        self._checked = True
        if self._queue.peek() is None:
            return "park"
        self._journal.message = "; ".join(found.outputs)  # until it is prepared
        self._stands &= not restarted
        if self._journal.at is None and self._by_hand.due(self._queue.peek()):
            return self._by_hand.ask()  # before anything is prepared, which a person might disturb
        session = self._session
        worked = (self._journal.fold.worked_s or -1.0) >= self._began_s  # one clock has been running since then
        certain, known = worked or session.gap_certain, worked or session.gap_known
        return self._standing.go_on(as_found, restarted, certain=certain, known=known)

    def _check_again(self) -> str:
        """After a hole in time the bench is checked as for a resumed run."""
        self._needs_set_up, self._stands = True, False
        if self._soaking is not None:
            self._soaking.watched = False  # the open whole plot is judged as one that an earlier session left
        at = self._journal.at
        if at is not None:
            at.attempt += 1
        return "repeat-check"

    def _preparing(self) -> str:
        self._put_back()
        following = self._queue.peek()
        if self._by_hand.due(following):
            return self._by_hand.ask()  # a step that belongs to a whole plot which is measured again
        if self._soaking is not None and following is not None and self._by_hand.unset_for_plot(following):
            return self._by_hand.ask_to_set(following)  # before a soak, which a person would disturb
        # homing does not disturb the environment
        chambers = self._do.readback()["chambers"] if self._stands or self._home_again else {}
        stands = self._standing.environment_stands(chambers) and (
            self._stands or (self._home_again and self._journal.fold.prepared)
        )
        goes_on = self._soaking is not None and following is not None and self._soaking.goes_on(following)
        self._journal.write(Preparing())
        self._needs_set_up |= self._soaking is not None  # the instruments are identified before every whole plot
        self._set_up()
        if self._do.home(self._poll_s, again=self._home_again):
            self._journal.write(Homed())
        self._home_again = False  # only now: homing that fails is asked for again
        if self._soaking is not None:
            if not goes_on:
                self._soaking.soak()
        elif self._conduct.environment is not None and stands and self._stands:
            self._journal.write(EnvironmentStands(chambers=chambers))
        elif self._conduct.environment is not None and not stands:
            self._journal.message = "environment settling"
            evidence = self._do.prepare_environment(self._conduct.environment)
            self._journal.write(EnvironmentSettled(chambers=evidence))
        self._stands = False  # what is prepared once more settles once more
        self._journal.message = ""
        self._journal.write(Prepared())
        return "recover"

    def _put_back(self) -> None:
        """Prepare the bench. The current point is next again, unless it has just been observed."""
        if self._journal.at is not None:
            self._queue.put_back(self._journal.at.point)
            self._journal.take_up(None)

    def _set_up(self, *, again: bool = False) -> None:
        if self._needs_set_up or again:
            self._do.set_up()
            self._needs_set_up = False
            for instrument, said in self._do.remarks():
                if (instrument, said) not in self._remarked:
                    self._remarked.add((instrument, said))
                    self._journal.write(Remark(instrument=instrument, message=said))

    def _holding(self) -> str:
        self._stands = False
        asked = self._by_hand.asked is not None
        self._needs_set_up |= asked and not self._by_hand.reads  # a person may have touched anything
        try:
            return self._hold.until_done() if asked else self._hold.until_released(self._released)
        except NobodyCame as nobody:
            return self._nobody_came(nobody)
        except CannotHold as error:
            return self._give_up(str(error), recorded=False)

    def _released(self) -> str:
        again = "" if self._checked else "repeat-check"
        return again or self._standing.go_on(self._do.readback(), self._do.restarted())

    def _nobody_came(self, nobody: NobodyCame) -> str:
        """A wait that lasts too long: the bench is parked and made safe, and the session can be resumed. A hold that
        nobody releases ends it with a fault, a step that nobody does interrupts it.
        """
        self._ending = str(nobody)
        self._outcome = Outcome.INTERRUPTED if nobody.asked else Outcome.FAULT
        if nobody.asked:
            self._journal.write(Interruption(signal=self._ending))
        else:
            self._journal.write(Fault(decision=ABORT, message=self._ending, state=str(self.state)))
        return "park"

    def _parking(self) -> str:
        # nothing moves before the instruments have been identified
        left = self._way_out.park(self._poll_s, self._point.move_timeout_s) if self._checked else ""
        self._ending = "; ".join(words for words in (self._ending, left) if words)
        fold = self._journal.fold
        complete = self._outcome is None and not fold.remaining and not left
        safe = self._way_out.make_safe(complete=complete)
        if safe.unsafe:
            return self._give_up(self._ending or "parked", safe=safe)
        if self._outcome is None:
            if fold.remaining:
                raise BenchFault(f"{fold.remaining} points are neither observed nor skipped; resume the run")
            self._outcome = Outcome.COMPLETE
            skipped = {str(index): why for index, why in fold.skipped.items()}
            lost = {str(number): why for number, why in fold.lost.items()}
            end = Ended(accepted=len(fold.accepted), skipped=skipped, records=0, head="")  # filled in by the writer
            if self._soaking is not None:
                end = replace(end, whole_plots=fold.whole_plots, lost=lost)
            self._journal.finish(end)
            self._bench.stands = bool(complete and self._bench.stays_on)
        else:
            self._journal.write(Parked())
        self._journal.message = self._ending
        return "finish"

    # --- what may go wrong ----------------------------------------------------------------------------------

    def _decide(self, error: Exception) -> str:
        """The trigger of the fault policy. Raises the error if no policy covers it."""
        state, at = self.state, self._journal.at if self.state in AT_POINT else None
        self._well.doubt_last(error)
        self._needs_set_up |= isinstance(error, DriverError)
        decision, error = self._deciding.decide(error, state)
        self._needs_set_up |= isinstance(error, DriverError)  # the readback may have failed with another error
        message = f"the soak failed: {error}" if decision.fault == "soak" else str(error)
        if isinstance(error, TemperatureLeft) and decision.action == ABORT:
            message += error.advice
        if decision.action == ABORT:  # in a run that is held no file can be changed
            simulated = self._journal.fold.simulated
            message += advice(error, state, self._conduct, self._run_list, self._bench.config, simulated=simulated)
        match decision.action:
            case action if action == ABORT:
                return self._give_up(message, recorded=False)
            case action if action == HOLD:
                return self._begin_hold(message, surely=False)
            case action if action == SKIP and at is not None:
                self._skip(at, message)
                return "skip"
            case action if action == RE_HOME:
                self._home_again = True
            case action if action == RE_SOAK and at is not None and self._soaking is not None:
                self._soaking.give_up(message)
            case _:
                if at is not None and not isinstance(error, TemperatureLeft):
                    return "retry"
        if state is State.CHECKING and not isinstance(error, TemperatureLeft):
            return "repeat-check"
        return "repeat-preparation" if state is State.PREPARING else "prepare"

    def _skip(self, at: PointInHand, reason: str) -> None:
        again = at.point.index not in self._put_off
        self._journal.write(Skipped.until_later(reason) if again else Skipped.for_good(reason))
        self._policies.done(at.place)
        if again:  # once: a point that is skipped a second time is skipped for good
            self._put_off.add(at.point.index)
            self._queue.put_off(at.point)
        self._journal.take_up(None)

    def _begin_hold(self, why: str, *, surely: bool = True, who: str | None = None) -> str:
        if surely:  # a fault policy that holds has tried to stop motion; here a failure to stop is itself a fault
            self._deciding.stop_motion()
        self._journal.write(Held(why=why, who=who))
        self._journal.message = why
        return "hold"

    def _interrupted(self) -> str | None:
        """Handle a signal: stop motion, record it, and leave the run for `rig resume`."""
        self._deciding.stop_motion()
        left, safe = self._way_out.leave()
        unsafe = () if safe is None else safe.unsafe
        self._journal.write(Interruption(signal=self._signals.interrupt, left_on=left or EMPTY, unsafe=unsafe or EMPTY))
        self._outcome = Outcome.UNSAFE if unsafe else Outcome.INTERRUPTED
        failed = {words.partition(":")[0] for words in unsafe}  # their values are in the words of the safe state
        others = [words for words in left if words.partition(" ")[0] not in failed]
        self._journal.message = "; ".join((*([safe.words] if safe and unsafe else []), *others))
        return None

    def _unforeseen(self, error: Exception) -> None:
        """Make the bench safe after a defect of the program, and record both. Raises `NotSafe` if it is not safe."""
        cause = f"unforeseen: {type(error).__name__}: {error}"
        try:
            safe = self._way_out.make_safe()
        except Exception as another:  # nothing is known then
            safe = MadeSafe(unsafe=(f"the bench: not known, check it on site: {another!r}",))
            with contextlib.suppress(Exception):  # the run file may be the defect
                self._journal.write(safe)
        with contextlib.suppress(Exception):
            self._journal.write(Fault(decision=ABORT, message=f"{cause}\n{safe.words}", state=str(self.state)))
        if safe.unsafe:
            raise NotSafe(f"{cause}\n{safe.words}") from error

    def _give_up(self, message: str, *, recorded: bool = True, safe: MadeSafe | None = None) -> str:
        """Make the bench safe first, then record why."""
        safe = safe or self._way_out.make_safe()  # before the record: that nothing can be written may be the fault
        self._outcome = Outcome.UNSAFE if safe.unsafe else Outcome.FAULT
        message += f"\n{safe.words}"
        if recorded:
            try:
                self._journal.write(Fault(decision=ABORT, message=message, state=str(self.state)))
            except StorageError as error:
                message += f"\n{error}"
        self._journal.message = message
        return "fault"
