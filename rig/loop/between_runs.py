"""The bench between two runs of a loop: what holds the environment stays on at its setting, so that the next run need
not settle again; everything else is in its safe state.

Only chambers and baths stay on, only if the procedure declares an environment, and only from the end of a complete run
to the begin of the next one. Meanwhile they are looked at. Whatever is not as it was left, an interlock, an
interruption, or the end of the time that a decision may take brings them to their safe state at once. So does every
end of the session, also by an error. Only a kill or a power cut leaves them on, as within a run; the next session makes
them safe before anything else.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any, Self

from rig.drivers.clock import Clock
from rig.drivers.errors import DriverError
from rig.engine.actions import BenchActions
from rig.engine.axes import Axes
from rig.engine.fault_classes import FAULTS
from rig.engine.guard import Guard
from rig.engine.holes import watched
from rig.engine.prepared_environment import stands
from rig.engine.safe_state import make_safe, outputs_on
from rig.engine.session import Signals
from rig.errors import NotSafe, RigError
from rig.instruments.opening import Bench
from rig.procedures.plan.conduct import EnvironmentSettings
from rig.run_file.events.loops import LoopMadeSafe
from rig.runs.controller import VIRTUAL, Site
from rig.runs.plans import Plan

MOST_S = 1800.0
"""Longest time for which chambers stay on between two runs, bench seconds: a decision takes minutes."""
_LOOK_S = 5.0
"""Time between two looks at them, bench seconds."""
_ALONE_S = 60.0
"""Time without a look after which nobody has watched them, bench seconds: the machine was asleep, or overloaded."""
_GRACES = 10.0
"""Where bench time runs faster than real time, a busy machine's pauses are longer in bench seconds."""
_BEARS = 2
"""Replies in succession that may be lost before a chamber counts as silent."""

Opened = tuple[Bench, Clock, str]


def _staying(plan: Plan, bench: Bench) -> frozenset[str]:
    """Names of what holds the environment of a plan; none if the bench file has any of it off at an interruption."""
    names = frozenset(bench.chambers if plan.procedure.conduct.environment is not None else ())
    return frozenset() if any(bench.config.safety.switched_off(name) for name in names) else names


def _touched(plan: Plan) -> bool:
    """Whether a person is asked for something before the first point."""
    return any(not step.before for step in plan.run_list.steps)


def _same_bench(plan: Plan) -> tuple[Any, ...]:
    """What two plans on one bench, in one world, have in common; simulated packages are turned by a new world."""
    mounting = plan.procedure.conduct.mounting if plan.dry else {}
    return plan.dry, plan.documents["bench.toml"], plan.documents.get("world.toml"), sorted(mounting.items())


@dataclass
class Kept:
    """An open bench whose chambers stay on.

    Attributes:
        found: bench, clock, and boot.
        stays: names of what stays on.
        environment: setting at which it stands.
        of: see `_same_bench`.
        close: makes safe what still stands, and closes the bench.
    """

    found: Opened
    stays: frozenset[str]
    environment: EnvironmentSettings
    of: tuple[Any, ...]
    close: contextlib.ExitStack


class Watch:
    """Looks at chambers that stay on, and makes them safe when something is not as it was left.

    Args:
        kept: the open bench.
        signals: an interruption makes them safe.

    Attributes:
        made: that they were made safe, and why; None while they stand.
    """

    def __init__(self, kept: Kept, signals: Signals) -> None:
        bench, clock, _ = kept.found
        config = bench.config
        self._kept, self._signals, self._clock = kept, signals, watched(clock)
        guard = Guard(config.limits, config.factors, config.interlocks, clock.now)
        self._do = BenchActions(bench, Axes(()), guard, clock, self._clock.sleep)
        locked = {rule.watch for rule in config.interlocks.values()}
        self._thermometers = [column for column in bench.temperatures if column in locked]
        self._unset = {bench.instruments[bench.temperatures[column][0]] for column in self._thermometers}
        self._began_s = self._seen_s = self._clock.now()
        self._lost = 0
        self._ends = threading.Event()
        self._thread: threading.Thread | None = None
        self.made: LoopMadeSafe | None = None

    def begin(self) -> None:
        """Look every few seconds from now on. Only on a bench in real time: in a dry loop no time passes by itself."""
        self._thread = threading.Thread(target=self._watching, name="between runs", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """No look any more: the bench belongs to the caller."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()

    def until(self, at_s: float) -> None:
        """Let the time of a dry loop pass, with looks."""
        while self.made is None and (left := at_s - self._clock.now()) > 0:
            self._clock.sleep(min(_LOOK_S, left))
            self.look()

    def _watching(self) -> None:
        while self.made is None and not self._ends.wait(self._clock.timeout(_LOOK_S)):
            self.look()

    def look(self) -> None:
        """Read the chambers, and make them safe if they do not stand as they were left."""
        try:
            why = self._why()
        except Exception as error:  # whatever it is, nobody watches them then
            why = f"they could not be watched: {error!r}"
        if why:
            bench, clock, _ = self._kept.found
            self.made = safe_again(bench, clock, self._kept.stays, why)

    def _why(self) -> str:
        """Why the chambers may not stay on; "" if they may."""
        if self._signals.interrupt:
            return f"interrupted ({self._signals.interrupt})"
        now = self._clock.now()
        alone_s, self._seen_s = now - self._seen_s, now
        if alone_s > _ALONE_S + _GRACES * self._clock.grace():
            return f"nobody watched them for {alone_s:.0f} s"
        if now - self._began_s > MOST_S:
            return f"the decision took longer than {MOST_S / 60.0:.0f} min"
        try:
            chambers = self._do.chambers.read()
            while self._unset:  # the run has left them in their safe state
                self._unset.pop().prepare()
            if self._thermometers:
                self._do.sweeps.temperatures(self._thermometers)
        except DriverError as error:
            self._lost += 1
            return str(error) if self._lost > _BEARS else ""
        except (*FAULTS, RigError) as error:
            return str(error)
        self._lost = 0
        return "" if stands(self._kept.environment, chambers) else "they do not stand as the run before left them"


def safe_again(bench: Bench, clock: Clock, names: Collection[str], why: str) -> LoopMadeSafe:
    """Bring what stays on to its safe state, and read it back."""
    bench.stands = False
    safe = make_safe(bench, clock, names)
    return LoopMadeSafe(words=f"{', '.join(safe.only)} {safe.words}", why=why, unsafe=safe.unsafe)


@dataclass
class BetweenRuns:
    """The benches of a loop's runs; one whose chambers stay on is kept open for the next run.

    Use it as a context: at its end nothing stays on that a run has not left on by itself (an interruption).

    Attributes:
        site: how benches are opened.
        permitted: whether anything may stay on.
        signals: an interruption makes safe what stays on.
        left_on: outputs that stay on, with their values.
        made: what was made safe and is not recorded yet.
    """

    site: Site
    permitted: bool
    signals: Signals
    left_on: tuple[str, ...] = ()
    made: list[LoopMadeSafe] = field(default_factory=list)
    _kept: Kept | None = None
    _watch: Watch | None = None

    def __enter__(self) -> Self:
        """Nothing stays on yet."""
        return self

    def __exit__(self, _kind: Any, error: BaseException | None, _trace: Any) -> None:
        """Make safe what stays on. What an error says is completed. Raises `NotSafe` if something is not safe."""
        self.rest("the loop's session ends")
        words = "; ".join(one.words for one in self.made)
        if error is None or not words:
            return
        if any(one.unsafe for one in self.made):
            raise NotSafe(f"{error}\n{words}") from error
        if isinstance(error, RigError):
            error.args = (f"{error}\n{words}",)
        else:
            error.add_note(words)

    @property
    def of_runs(self) -> Site:
        """The site of the loop's runs."""
        return Site(self._opened, self.site.vfs)

    @property
    def stands_at(self) -> float | None:
        """Setting, degC, at which the environment stands for the next run; None if it does not."""
        kept = self._kept
        return kept.environment.setpoint_degC if kept is not None and kept.found[0].stands else None

    def rest(self, why: str) -> None:
        """Make safe what stays on, and close its bench."""
        kept, watch, self._kept, self._watch, self.left_on = self._kept, self._watch, None, None, ()
        if watch is not None:
            watch.end()
            self.made += [watch.made] if watch.made is not None else []
        if kept is not None:
            try:
                self._made_safe(kept, why)
            finally:
                kept.close.close()

    def hand_over(self, plan: Plan) -> None:
        """Before the next run: make safe what it does not take over."""
        kept = self._kept
        if kept is None:
            return
        if kept.of != _same_bench(plan):
            self.rest("the next run is of another bench")
        elif _touched(plan):
            self.rest("a person comes to the bench before the next run")
        elif plan.procedure.conduct.environment is None:
            self.rest("the next run has no environment")

    @contextlib.contextmanager
    def _opened(self, plan: Plan, *, start: float = 0.0) -> Iterator[Opened]:
        """The bench of a run: the kept one, or one that is opened now. See `Site.opened`."""
        self.hand_over(plan)
        with contextlib.ExitStack() as close:
            found = self._taken(close, start) or close.enter_context(self.site.opened(plan, start=start))
            bench, _, boot = found
            bench.stays_on = _staying(plan, bench) if self.permitted else frozenset()
            environment = plan.procedure.conduct.environment
            if environment is not None:
                kept = Kept(found, bench.stays_on, environment, _same_bench(plan), contextlib.ExitStack())
                close.callback(self._made_safe, kept, "the next run did not begin")
            yield found
            if environment is not None and bench.stands:
                self.left_on = tuple(outputs_on(bench, sorted(bench.stays_on)))
                self._watch = Watch(kept, self.signals)
                self._kept, kept.close = kept, close.pop_all()
                if boot != VIRTUAL:
                    self._watch.begin()

    def _taken(self, close: contextlib.ExitStack, start: float) -> Opened | None:
        """The kept bench for the next run; None if there is none, or if it does not stand any more."""
        kept, watch = self._kept, self._watch
        if kept is None or watch is None:
            return None
        if kept.found[2] == VIRTUAL:
            watch.until(start)
        watch.end()
        if watch.made is None:
            watch.look()  # the last one, by the thread that goes on with the bench
        if watch.made is not None:
            self.rest(watch.made.why)
            return None
        self._kept = self._watch = None
        close.push(kept.close)
        return kept.found

    def _made_safe(self, kept: Kept, why: str) -> None:
        """Make safe what no run has taken over."""
        bench, clock, _ = kept.found
        if bench.stands:
            self.made.append(safe_again(bench, clock, kept.stays, why))
