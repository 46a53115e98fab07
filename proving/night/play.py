"""Playing a night: sessions of the real controller on a simulated bench that lives on between them.

What ends a session like a kill does is raised out of the world, wherever the controller happens to be waiting. What
the disk holds at that instant is set aside before anything unwinds, no byte reaches a wire any more, and the next
session finds exactly that: neither a handler of ours nor SQLite's own tidying up has a say in it.
"""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Literal, NoReturn

from proving.disk import Crash, Disk, folding
from proving.night.mishaps import Mishap
from proving.night.safety import not_safe
from proving.night.scenario import Scenario
from rig.bench.bench_file import check_options
from rig.drivers.clock import Clock
from rig.drivers.wires import Wires
from rig.engine.holes import WatchedClock
from rig.engine.session import Outcome, Signals
from rig.errors import RigError
from rig.instruments.opening import Bench, open_bench
from rig.run_file.live import live_path, send_request
from rig.runs.controller import Site, resume_run, start_run
from rig.runs.plans import Plan, plan_of
from rig.sims.tape import Tape
from rig.simulated.dry_run import DryBench

MOST_SESSIONS = 40
"""A night that is not over after so many starts of the controller is a dead end."""

SAFE_WITHIN_S = 10.0
"""So long after a session's end all must be at rest: what is stopped still decelerates."""

_SLOWER = 30.0
"""Bench seconds in a second of the machine: how often the live state is written and requests are looked for."""


class Killed(BaseException):
    """The controller's process ends here. Nothing of ours may catch it."""


@dataclass(frozen=True)
class Ended:
    """One session of the controller.

    Attributes:
        began_s: world time of its start.
        ended_s: and of its end.
        how: "killed", "crashed", "refused", or the outcome in words.
        message: what it said.
        outcome: the sequencer's own, None where it had none.
        not_safe: what was truly not safe when it ended; nothing is asked of a process that was killed.
        skipped: points given up so far.

    """

    began_s: float
    ended_s: float
    how: str
    message: str
    outcome: Outcome | None = None
    not_safe: tuple[str, ...] = ()
    skipped: int = 0


@dataclass
class Played:
    """A night that was played.

    Attributes:
        scenario: what was to happen.
        plan: what was to be run.
        path: the run file, None where none was ever created.
        sessions: every start of the controller.
        happened: (world time, what) of mishaps that met anything.
        bench: the simulated bench, for its truth.

    """

    scenario: Scenario
    plan: Plan
    bench: DryBench
    path: Path | None = None
    sessions: list[Ended] = field(default_factory=list)
    happened: list[tuple[float, str]] = field(default_factory=list)

    @property
    def tape(self) -> Tape:
        """What truly happened."""
        assert self.bench.sim.tape is not None
        return self.bench.sim.tape

    @property
    def complete(self) -> bool:
        """Whether the run was finished."""
        return bool(self.sessions) and self.sessions[-1].outcome is Outcome.COMPLETE

    def skipped(self) -> int:
        """Points that were given up, as the last session tells."""
        return self.sessions[-1].skipped if self.sessions else 0


class _Stage:
    """The bench of a night and the machine of its controller."""

    def __init__(self, scenario: Scenario, folder: Path, disk: Disk) -> None:
        self.plan = plan_of(scenario.documents, dry=True)
        # Its key is in messages: no counter.
        self.bench = DryBench(self.plan.bench, self.plan.truth, key="night", record_tape=True)
        self.world = self.bench.world
        # Nothing in a night may depend on how fast this machine is.
        self.world.stopwatch = lambda: self.world.now() / _SLOWER
        self.world.idle = self.world.sleep  # type: ignore[method-assign]
        self.played = Played(scenario, self.plan, self.bench)
        self._folder = folder
        self._signals = Signals()
        self._running = False
        self._dead = False
        self._boot = 1
        self._disk = disk
        self._lost: Literal["none", "some"] = "none"
        self._live: tuple[Path, bytes] | None = None
        for mishap in scenario.mishaps:
            self.world.call_in(mishap.at_s - self.world.now(), partial(self._happen, mishap))

    # --- the controller's machine -----------------------------------------------------------------------------

    @contextlib.contextmanager
    def opened(self, plan: Plan, *, start: float) -> Iterator[tuple[Bench, Clock, str]]:
        """See `rig.runs.controller.opened`; the bench is the same in every session, and its time goes on by itself."""
        del start
        clock = WatchedClock(self.world)
        wires = Wires(clock, simulated=self.bench.sim.transports(), tap=self._tap)
        config = self.bench.config
        bench = open_bench(config, check_options(config, "bench.toml"), clock, wires)
        bench.person = self.bench.person
        try:
            yield bench, clock, f"night-{self._boot}"
        finally:
            bench.close()

    def _tap(self, instrument: str, direction: str, data: bytes) -> None:
        if self._dead:
            raise Killed

    def session(self) -> Ended:
        """Start the controller, and let it go on until it ends."""
        began = self.world.now()
        self._signals, self._running, self._dead = Signals(), True, False
        site = Site(self.opened, self._disk.name)
        outcome, message, skipped = None, "", 0
        try:
            if self.played.path is None:
                result = start_run(
                    self.plan,
                    self._folder,
                    signals=self._signals,
                    announce=self._announced,
                    on_progress=lambda _: None,
                    site=site,
                )
            else:
                result = resume_run(self.played.path, signals=self._signals, on_progress=lambda _: None, site=site)
            outcome, how, message = result.outcome, result.outcome.value, result.message
            skipped = len(result.state.skipped)
        except (Killed, Crash):
            how = "killed"
        except RigError as error:
            how, message = "refused", str(error)
        except MemoryError as error:
            how, message = "crashed", repr(error)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            how, message = "unforeseen", f"{error!r} in {Path(where.filename).name}, line {where.lineno}"
        self._running, ended = False, self.world.now()
        left: tuple[str, ...] = ()
        if how == "killed":
            self._bury()
        elif how != "refused":
            self.world.sleep(SAFE_WITHIN_S)
            left = tuple(not_safe(self.bench, moving_only=outcome is Outcome.INTERRUPTED))
        for cable in self.bench.sim.cables.values():
            cable.attach(None)  # a dead process holds no port
        return Ended(began, ended, how, message, outcome, left, skipped)

    def _announced(self, path: Path) -> None:
        self.played.path = path

    # --- what happens -----------------------------------------------------------------------------------------

    def _happen(self, mishap: Mishap) -> None:
        if mishap.kind == "power-cut":
            self.bench.sim.power_cycle()
        elif not self._running:
            return
        self.played.happened.append((self.world.now(), str(mishap)))
        if not self._running:
            return
        match mishap.kind:
            case "kill":
                self._die("none")
            case "reboot" | "power-cut":
                self._boot += 1
                self._die("some")
            case "disk-full":
                self._disk.full_after(round(mishap.options["room_bytes"]))
            case "failed-sync":
                self._disk.fail_sync(round(mishap.options["nth"]))
            case "slow-disk":
                self._disk.slow(self.world, 0.02, 0.5)
                self.world.call_in(mishap.options["for_s"], partial(self._disk.slow, None))
            case "terminate":
                self._signals.interrupt = "SIGTERM"
            case "hold":
                self._ask("hold")
                self.world.call_in(mishap.options["for_s"], partial(self._ask, "release"))
            case "stop":
                self._ask("stop")
            case "answer":
                value = mishap.options.get("value")
                self._ask("done", **({} if value is None else {"value": str(value)}))
            case "suspend":
                self.world.suspend(mishap.options["for_s"])
            case "no-memory":
                raise MemoryError("drawn for this night")

    def _ask(self, verb: str, **more: str) -> None:
        if self._running and self.played.path is not None:
            with contextlib.suppress(FileExistsError):
                send_request(self.played.path, verb, **more)

    def _die(self, lost: Literal["none", "some"]) -> NoReturn:
        """End the process here: no byte leaves it any more, and none of its writes reaches the disk."""
        self._dead = self._disk.crashed = True
        self._lost = lost
        path = self.played.path
        live = None if path is None else live_path(path)
        self._live = (live, live.read_bytes()) if live is not None and live.exists() else None
        raise Killed

    def _bury(self) -> None:
        """What the dead process, or its machine, leaves behind."""
        self._disk.power_cut(self._lost)
        if self._live is not None:
            self._live[0].write_bytes(self._live[1])

    def repair(self) -> None:
        """What a person does in the morning: makes room on the disk."""
        self._disk.full_after(None)


_AT_LAST_S = 600.0
"""Between sessions beyond those that gaps are drawn for: somebody takes his time to look at what is wrong."""


def play(scenario: Scenario, folder: Path) -> Played:
    """Play a night in an empty folder; whoever gets it closes its bench."""
    with Disk(scenario.seed) as disk, folding(scenario.fold_pages):
        stage = _Stage(scenario, folder, disk)
        played = stage.played
        for number in range(MOST_SESSIONS):
            played.sessions.append(stage.session())
            if played.complete:
                break
            stage.repair()
            gaps = scenario.gaps_s
            stage.world.sleep(gaps[number] if number < len(gaps) else _AT_LAST_S)
    played.happened += [(h.t_s, f"{h.fault.kind} on {h.fault.on}: {h.what}") for h in played.bench.sim.faults.happened]
    played.happened.sort()
    return played
