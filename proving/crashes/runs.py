"""Short dry runs on a simulated disk that crash where they are told to, and what must be true of them afterwards.

The quick tests do a share of it, `python -m proving crashes` all of it.
"""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal
from unittest.mock import patch

import apsw

from proving.crashes.kills import judge
from proving.disk import Crash, Disk
from rig.engine.session import Outcome, Signals
from rig.examples import example
from rig.run_file.live import LiveState
from rig.run_file.read.reader import RunReader
from rig.run_file.write.writer import RunWriter
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import Plan, plan_of

ATTITUDE = """
kind = "pitch-roll"
name = "crashes"
replications = 2
[design]
type = "D"
pitch_deg = [-60, -20, 20, 60]
roll_deg = [-90, 0, 90]
[settle]
dwell_s = 2
[measure]
readings = 2
"""

PRESSURE = """
kind = "whole-plot"
name = "crashes"
seed = 3
[design]
type = "list"
temperatures_degC = [[10, 20], [20, 10], [20, 20], [15, 15]]
pressures_psia = [0.5, 1.0, 2.5]
repeated_psia = []
[model]
formula = "1 + P"
[soak]
dwell_s = 60
drift_degC_per_h = 10
[settle]
dwell_s = 4
[measure]
readings = 2
"""

PROCEDURES = {"attitude": ATTITUDE, "pressure": PRESSURE}
Lost = Literal["all", "none", "some"]

CHECKPOINT_PAGES = 60
"""So that a short run folds its log into the file and begins it again several times, as a long one does."""


@cache
def plan(lab: str) -> Plan:
    """A short run of a laboratory."""
    bench, world = ((example(f"{lab}-lab") / name).read_text() for name in ("bench.toml", "world.toml"))
    return plan_of({"bench.toml": bench, "procedure.toml": PROCEDURES[lab], "world.toml": world}, dry=True)


@dataclass
class Run:
    """A run on a disk, through however many crashes.

    Attributes:
        lab: which laboratory.
        folder: where the run file is made.
        disk: what it lies on.
        acknowledged: hash by sequence number, of every accepted observation whose commit returned.
        warnings: what resuming said was lost.

    """

    lab: str
    folder: Path
    disk: Disk
    acknowledged: dict[int, bytes] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @property
    def path(self) -> Path | None:
        """Its run file, where there is one by now."""
        return next(iter(self.folder.glob("*.sqlite")), None)

    def go_on(self) -> bool:
        """Start, or resume; False if it crashed."""
        path = self.path
        with self._watched():
            try:
                if path is None:
                    result = start_run(
                        plan(self.lab),
                        self.folder,
                        signals=Signals(),
                        announce=lambda _: None,
                        on_progress=lambda _: None,
                    )
                else:
                    result = resume_run(path, signals=Signals(), on_progress=lambda _: None, warn=self.warnings.append)
            except Crash:
                return False
        assert result.outcome is Outcome.COMPLETE, result.message
        return True

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        commit, remove = RunWriter.commit, LiveState.remove

        def acknowledging(run: RunWriter) -> None:
            pending = list(run._pending)
            commit(run)
            for seq, _, kind, _, _, _, _, _, status, _, _, own in pending:
                if kind == "observation" and status == "accepted":
                    self.acknowledged[seq] = own

        def leaving(live: LiveState) -> None:
            if not self.disk.crashed:  # a program that is gone takes nothing away
                remove(live)

        def hook(connection: apsw.Connection) -> None:
            connection.wal_autocheckpoint(CHECKPOINT_PAGES)

        apsw.connection_hooks.append(hook)
        try:
            with patch.object(RunWriter, "commit", acknowledging), patch.object(LiveState, "remove", leaving):
                yield
        finally:
            apsw.connection_hooks.remove(hook)

    def judge(self) -> str:
        """What is wrong with the finished run, "" if nothing."""
        assert self.path is not None
        tally = judge(self.path)
        with RunReader.open(self.path) as reader:
            hashes = {seq: own for seq, _, _, own in reader.chained()}
        gone = sorted(seq for seq, own in self.acknowledged.items() if hashes.get(seq) != own)
        wrong = [f"{tally.lost} lost"] * bool(tally.lost) + [f"{tally.duplicated} duplicated"] * bool(tally.duplicated)
        wrong += [f"{tally.wrong_side} from the wrong side"] * bool(tally.wrong_side)
        wrong += [f"acknowledged records gone: {gone}"] * bool(gone)
        return ", ".join(wrong)


def crash_once(lab: str, folder: Path, nth: int, lost: Lost, seed: int) -> tuple[bool, Run, str]:
    """Crash at the nth write or sync, cut the power, and go on to the end.

    Returns:
        whether there was an nth write or sync, the run, and what is wrong with it.

    """
    folder.mkdir(parents=True, exist_ok=True)
    with Disk(seed=seed, default=True) as disk:
        run = Run(lab, folder, disk)
        disk.crash_at(nth)
        crashed = not run.go_on()
        disk.power_cut(lost)
        if crashed:
            if run.path is None and run.acknowledged:
                return True, run, "the run file is gone"
            run.go_on()
        return crashed, run, run.judge()


def power_cuts(lab: str, folder: Path, seed: int, cuts: int) -> tuple[int, Run, str]:
    """Cut the power at random moments, up to so many times, and go on to the end.

    Returns:
        how many cuts there were, the run, and what is wrong with it.

    """
    rng = random.Random(seed)
    folder.mkdir(parents=True, exist_ok=True)
    with Disk(seed=seed, default=True) as disk:
        run = Run(lab, folder, disk)
        done = 0
        while True:
            if done < cuts:
                disk.crash_at(rng.randint(1, rng.choice((10, 30, 100))))
            if run.go_on():
                return done, run, run.judge()
            disk.power_cut(rng.choice(("all", "some", "some")))
            done += 1
