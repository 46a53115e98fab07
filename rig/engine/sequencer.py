"""The sequencer: one flat state machine that carries a run list out, point by point, into a run file.

Every state has one handler, which does its work and answers with the trigger that follows; the table of states
(`rig.engine.states`) says which triggers are permitted. Resuming is the ordinary way to run: a new run is a run
of which nothing has been observed yet.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from transitions import Machine

from drivers.clock import Clock
from drivers.errors import DriverError
from procedures import PitchRollProcedure, Procedure, RunList, WholePlotProcedure
from procedures.whole_plot import WholePlotFaults
from rig.bench import Bench, identities
from rig.engine.actions import BenchActions, NotSettled
from rig.engine.at_point import AtPoint
from rig.engine.axes import axes_of, own_limits
from rig.engine.early_warning import EarlyWarnings
from rig.engine.guard import Guard
from rig.engine.identities import compare_identities
from rig.engine.journal import Journal, PointInHand
from rig.engine.live import Requests
from rig.engine.policies import OverloadedError, policy_for
from rig.engine.queue import PointQueue
from rig.engine.run_file import RunWriter
from rig.engine.session import Outcome, Progress, Session, Signals
from rig.engine.soaking import Soaking
from rig.engine.state import RunState
from rig.engine.states import AT_POINT, FINAL, TRANSITIONS, State
from rig.errors import BenchFault, RigError, StorageError
from rig.previous import Previous


class _Interrupted(Exception):
    pass


class _HoldRequested(Exception):
    pass


class _StopRequested(Exception):
    pass


class Sequencer:
    """Carries out a run.

    Args:
        bench: opened instruments.
        run: the run file, locked for writing.
        state: what the run file says so far.
        run_list: every point.
        procedure: settle, measure and fault settings.
        clock: bench time.
        session: this start of the controller.
        signals: looked at wherever the sequencer waits.
        on_progress: called with news, often.
        previous: the last calibration of these sensors, for early warnings.

    """

    def __init__(
        self,
        *,
        bench: Bench,
        run: RunWriter,
        state: RunState,
        run_list: RunList,
        procedure: Procedure,
        clock: Clock,
        session: Session,
        signals: Signals,
        on_progress: Callable[[Progress], None],
        previous: Previous | None = None,
    ) -> None:
        self._bench, self._path = bench, run.path
        self._run_list, self._procedure = run_list, procedure
        self._clock, self._session, self._signals = clock, session, signals
        self._journal = Journal(run, state, clock, session, on_progress, run_list.whole_plots)
        self._axes = axes_of(bench, run_list.easy)
        self._guard = Guard(bench.config.limits, bench.config.factors)
        self._do = BenchActions(bench, self._axes, self._guard, clock, self._wait)
        self._journal.settling = lambda: self._do.judges
        self._requests = Requests(run.path, session.number, clock.stopwatch)
        self._queue = PointQueue(run_list, state)
        self._soaking: Soaking | None = None
        if isinstance(procedure, WholePlotProcedure):
            self._soaking = Soaking(
                bench=bench,
                run_list=run_list,
                procedure=procedure,
                do=self._do,
                journal=self._journal,
                queue=self._queue,
                clock=clock,
                wait=self._wait,
            )
        self._point = AtPoint(
            bench=bench,
            run_list=run_list,
            procedure=procedure,
            do=self._do,
            journal=self._journal,
            queue=self._queue,
            soaking=self._soaking,
            set_up=self._set_up,
            warnings=self._early_warnings(run, state, previous),
        )
        self._poll_s = procedure.settle.poll_s
        self._put_off = set(state.put_off)
        self._released = False
        self._outcome: Outcome | None = None
        self._needs_set_up = True
        self._soak_failures = 0
        self._machine = Machine(
            states=[str(s) for s in State],
            initial=str(State.READY),
            transitions=[
                {"trigger": t.trigger, "source": [str(s) for s in t.sources], "dest": str(t.target)}
                for t in TRANSITIONS
            ],
            auto_transitions=False,
        )
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
        """Where the sequencer is."""
        return State(self._machine.state)

    @property
    def message(self) -> str:
        """What is going on; after the end, what there is to say about it."""
        return self._journal.message

    def _early_warnings(self, run: RunWriter, state: RunState, previous: Previous | None) -> EarlyWarnings | None:
        if not self._procedure.warnings.enabled:
            return None
        mounting = getattr(self._procedure, "mounting", None)
        turned = {} if mounting is None else mounting.model_dump()
        warnings = EarlyWarnings(self._run_list, previous, turned)
        if state.worked_s is not None:
            warnings.recall(run)
        return warnings

    # --- the loop -------------------------------------------------------------------------------------------

    def run(self) -> Outcome:
        """Work until done, stopped, interrupted or faulted; the bench is then safe, unless the answer is `UNSAFE`."""
        try:
            self._journal.open()
            while self.state not in FINAL:
                trigger = self._next_trigger()
                if trigger is None:
                    break
                self._machine.trigger(trigger)
                self._journal.state = self.state
                self._journal.tell()
            return self._outcome or Outcome.FAULT
        except BaseException:
            self._bench.make_safe()  # an error nobody foresaw: safe state first, then the traceback
            raise
        finally:
            self._journal.close()

    def _next_trigger(self) -> str | None:
        """The trigger that follows; None to leave the loop where it is, for a later resume."""
        try:
            try:
                return self._handled()
            except _Interrupted:
                return self._interrupted()
            except _HoldRequested:
                return self._begin_hold("asked for")
            except _StopRequested:
                self._outcome = Outcome.STOPPED
                self._do.stop_motion()
                self._journal.write("stop")
                return "park"
        except StorageError as error:
            return self._give_up(str(error), recorded=False)
        except (NotSettled, OverloadedError, DriverError, RigError) as error:
            return self._give_up(str(error))

    def _handled(self) -> str:
        """What the state's handler answers, or the procedure's policy for what went wrong in it."""
        try:
            return self._handlers[self.state]()
        except (NotSettled, OverloadedError, DriverError) as error:
            return self._decide(error)  # may wait, and so be interrupted like everything else

    # --- waiting, signals, requests -------------------------------------------------------------------------------

    def _wait(self, seconds: float) -> None:
        """Let bench time pass in slices, looking up between them."""
        end = self._clock.now() + seconds
        while (left := end - self._clock.now()) > 1e-9:
            self._clock.sleep(min(left, 5.0))
            self._look_up()
        self._do.look_around()

    def _look_up(self) -> None:
        if self._signals.interrupt:
            raise _Interrupted
        request = self._requests.poll()
        if request is not None and self.state != State.PARKING:
            self._journal.acknowledge(request.request_id)
            if request.verb == "stop":
                raise _StopRequested
            if request.verb == "hold" and self.state != State.HOLDING:
                raise _HoldRequested
            self._released = request.verb == "release"
        self._journal.tell()

    # --- handlers, one a state ------------------------------------------------------------------------------

    def _checking(self) -> str:
        found = identities(self._bench)
        compare_identities(self._journal, found, self._session.accept, self._path)
        self._do.stop_motion()
        restarted = self._do.restarted()
        as_found = self._do.readback()
        self._journal.write("event", {**as_found, "restarted": restarted}, status="as-found")
        self._guard.check_run_list(self._run_list, own_limits(self._bench, self._run_list))
        if self._queue.peek() is None:
            return "park"
        return self._go_on(as_found, restarted, certain=self._session.gap_certain)

    def _go_on(self, as_found: Mapping[str, Any], restarted: Sequence[str], *, certain: bool = True) -> str:
        """Whether what was prepared still stands, by what was just read."""
        fold = self._journal.fold
        # Counted from the last work done, so that sessions which were killed while preparing do not hide a gap.
        idle_s = self._journal.elapsed() - (fold.worked_s or 0.0)
        point = self._queue.peek()
        if self._soaking is not None and point is not None:
            if fold.whole_plot is None or point.whole_plot != fold.planned:
                return "prepare"
            why = self._soaking.rules.lost_meanwhile(
                point, idle_s, certain=certain, restarted=restarted, as_found=as_found
            )
            if not why:
                return "recover"
            self._soaking.lose(why)
            return "prepare"
        homed = all(axis["homed"] for axis in as_found["axes"].values())
        stands = homed and self._environment_stands(as_found)
        assert isinstance(self._procedure, PitchRollProcedure)
        if fold.prepared and stands and idle_s <= self._procedure.recovery.max_gap_s:
            return "recover"
        return "prepare"

    def _environment_stands(self, as_found: Mapping[str, Any]) -> bool:
        wanted = self._procedure.environment if isinstance(self._procedure, PitchRollProcedure) else None
        return wanted is None or all(
            c["running"]
            and abs(c["setpoint_degC"] - wanted.setpoint_degC) < 0.05
            and abs(c["temperature_degC"] - wanted.setpoint_degC) <= wanted.tolerance_degC
            for c in as_found["chambers"].values()
        )

    def _preparing(self) -> str:
        self._journal.take_up(None)
        self._journal.write("event", status="preparing")
        self._needs_set_up |= self._soaking is not None  # every whole plot begins with instruments that are known
        self._set_up()
        if self._do.home(self._poll_s):
            self._journal.write("event", status="homed")
        if self._soaking is not None:
            self._soaking.soak()
            self._soak_failures = 0
        elif isinstance(self._procedure, PitchRollProcedure) and self._procedure.environment is not None:
            self._journal.message = "environment settling"
            evidence = self._do.prepare_environment(self._procedure.environment)
            self._journal.write("event", evidence, status="environment-settled")
            self._journal.message = ""
        self._journal.write("event", status="prepared")
        return "recover"

    def _set_up(self) -> None:
        if self._needs_set_up:
            self._do.set_up()
            self._needs_set_up = False

    def _holding(self) -> str:
        self._journal.message = "held; release it with `rig release`"
        self._released = False
        limit = self._clock.now() + self._procedure.recovery.hold_max_s
        while not self._released:
            self._do.look_around()
            self._clock.idle(1.0)
            self._look_up()
            if self._clock.now() > limit:
                raise BenchFault(f"held for {self._procedure.recovery.hold_max_s / 3600:g} h and nobody released it")
        self._journal.message = ""
        self._journal.write("release")
        return self._go_on(self._do.readback(), self._do.restarted())

    def _parking(self) -> str:
        self._set_up()
        self._do.park(self._poll_s, self._point.move_timeout_s)
        unsafe = self._bench.make_safe()
        if unsafe:
            raise BenchFault("parked, but not everything could be brought to its safe state: " + "; ".join(unsafe))
        if self._outcome is None:
            self._outcome = Outcome.COMPLETE
            fold = self._journal.fold
            skipped = {str(index): why for index, why in fold.skipped.items()}
            lost = {str(number): why for number, why in fold.lost.items()}
            also = {"whole_plots": fold.whole_plots, "lost": lost} if self._soaking is not None else {}
            self._journal.finish({"accepted": len(fold.accepted), "skipped": skipped, **also})
        else:
            self._journal.write("event", status="parked")
        return "finish"

    # --- what may go wrong ----------------------------------------------------------------------------------

    def _decide(self, error: Exception) -> str:
        """Policy for an error at a point; anywhere else, and for errors no policy covers, it is a fault."""
        at = self._journal.at
        faults = self._procedure.faults
        if self.state == State.PREPARING and self._soaking is not None:
            return self._soak_failed(error)
        policy = policy_for(error, faults)
        if at is None or policy is None or self.state not in AT_POINT:
            raise error
        self._needs_set_up = isinstance(error, DriverError)
        at.failures += 1
        decision = "retry" if at.failures <= self._procedure.faults.retries else policy
        body = {"message": str(error), "evidence": getattr(error, "evidence", {}), "error": type(error).__name__}
        self._journal.write("fault", body, status=decision)
        if decision == "abort":
            return self._give_up(str(error), recorded=False)
        self._stop_patiently(error)
        at.attempt += 1
        self._journal.message = f"point {at.point.index}, {decision}: {error}"
        if decision == "hold":
            return self._begin_hold(str(error))
        if decision == "skip":
            self._skip(at, str(error))
        return decision

    def _soak_failed(self, error: Exception) -> str:
        """An instrument that fails in a soak gets its retries; temperatures that do not settle have had their time."""
        faults = self._procedure.faults
        assert isinstance(faults, WholePlotFaults)
        self._needs_set_up = isinstance(error, DriverError)
        self._soak_failures += 1
        again = isinstance(error, DriverError) and self._soak_failures <= faults.retries
        policy = "retry" if again else faults.soak
        body = {"message": str(error), "evidence": getattr(error, "evidence", {}), "error": type(error).__name__}
        self._journal.write("fault", body, status=policy)
        if again:
            self._stop_patiently(error)
            self._journal.message = f"soak, retry: {error}"
            return "repeat-preparation"
        message = f"the soak failed: {error}"
        if policy == "abort":
            return self._give_up(message, recorded=False)
        self._journal.message = message
        return self._begin_hold(message)

    def _stop_patiently(self, error: Exception) -> None:
        """Stop motion; an instrument that has just failed to answer gets time to come back before it is asked again."""
        pauses = _PAUSES_S if isinstance(error, DriverError) else ()
        for pause in pauses:
            self._wait(pause)
            with contextlib.suppress(DriverError):
                self._do.stop_motion()
                return
        self._do.stop_motion()

    def _skip(self, at: PointInHand, reason: str) -> None:
        again = at.point.index not in self._put_off
        status = "later" if again else "final"
        self._journal.write("skip", {"reason": reason}, status=status)
        if again:
            self._put_off.add(at.point.index)
            self._queue.put_off(at.point)
        self._journal.take_up(None)

    def _begin_hold(self, why: str) -> str:
        self._do.stop_motion()
        self._journal.write("hold", {"why": why})
        return "hold"

    def _interrupted(self) -> str | None:
        """A signal: stop motion, record it, and leave the run for `rig resume`."""
        self._do.stop_motion()
        self._journal.write("event", {"signal": self._signals.interrupt}, status="interrupted")
        self._outcome = Outcome.INTERRUPTED
        return None

    def _give_up(self, message: str, *, recorded: bool = True) -> str:
        """Safe state first, then say why."""
        unsafe = self._bench.make_safe()
        self._outcome = Outcome.UNSAFE if unsafe else Outcome.FAULT
        if unsafe:
            message += "\nNOT everything could be brought to its safe state: " + "; ".join(unsafe)
        if recorded:
            try:
                self._journal.write("fault", {"message": message, "state": str(self.state)}, status="abort")
            except StorageError as error:
                message += f"\n{error}"
        self._journal.message = message
        return "fault"


_PAUSES_S = (1.0, 5.0, 15.0, 60.0)
