"""Early looks: the run so far is traced after every replication, in the background, and what emerges becomes a warning.

A look is a process of its own (`look_once`), which a thread waits for. The controller never waits: it asks for events
with its next record. A look that is killed, too slow or fails is said once, and the run is as it was. All looks
together take at most `SHARE` of one processor, over the time of the run.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tomllib
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.run_file.chain import Record
from rig.run_file.events.bench import Emerging
from rig.run_file.events.points import Observed
from rig.run_file.read.reader import RunReader
from rig.unattended.worker import Worker

SHARE = 0.05
"""Share of one processor that looks may take, over the time of the run."""
_LEAST_S = 4.0
"""Processor time without which no look begins: to start, read and trace a small run."""
_LEVEL = 0.05
"""Probability of a false warning in a whole run, by the probabilities of the traces."""
_REAL_S = 3600.0
"""Longest look, in real seconds: a busy machine gives a process of lowest priority little time."""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
COMMAND = (sys.executable, "-m", "rig.unattended.look_once")


@dataclass(frozen=True)
class _Task:
    """A look: the run file, the words for its moment ("replication 2"), and its processor time."""

    run: Path
    moment: str
    most_s: float


@dataclass
class EarlyLook:
    """Looks at runs, one after the other; its methods never raise and never wait.

    Attributes:
        command: what a look executes, before the run file and its processor time.
        dry: whether to look at dry runs as well, whose hours pass in seconds.
    """

    command: Sequence[str] = COMMAND
    dry: bool = False
    _run: Path | None = None
    _moments: dict[int, str] = field(default_factory=dict)
    _used_s: float | None = None
    _since: dict[str, str] = field(default_factory=dict)
    _told: set[tuple[str, ...]] = field(default_factory=set)
    _failed: bool = False
    _events: deque[Emerging] = field(default_factory=deque)
    _worker: Worker[_Task] | None = None
    _process: subprocess.Popen[bytes] | None = None
    _closing: bool = False

    def begins(self, run: Path) -> None:
        """A run begins, or goes on. Its procedure says whether it is looked at; a dry one is not."""
        self._run, self._moments, self._since, self._told = run, {}, {}, set()
        self._used_s, self._failed = None, False
        self._events.clear()
        with contextlib.suppress(Exception), RunReader.open(run) as reader:
            asked = tomllib.loads(reader.documents()["procedure.toml"]).get("warnings", {})
            if (self.dry or not reader.about().runs_dry) and asked.get("enabled", True) and asked.get("look", True):
                self._moments = _moments([point.replication for point in reader.run_list().points])

    def recorded(self, record: Record) -> None:
        """A record of the run was appended; after the last point of a replication a look begins."""
        if self._used_s is None:  # looks of an earlier session have taken all that they were allowed
            self._used_s = SHARE * record.elapsed_s
        moment = self._moments.get(record.run_index if record.run_index is not None else -1)
        if moment is None or self._run is None or record.kind != Observed.kind or not record.accepted:
            return
        allowed_s = SHARE * record.elapsed_s - self._used_s
        if allowed_s < _LEAST_S or (self._worker is not None and not self._worker.idle()):
            return
        self._used_s += allowed_s  # until the look says what it took
        if self._worker is None:
            self._worker = Worker("early looks", self._look, limit=1)
        self._worker.put(_Task(self._run, moment, allowed_s))

    def to_note(self) -> list[Emerging]:
        """Warnings that are not recorded yet; each is returned once."""
        found = []
        while self._events:
            found.append(self._events.popleft())
        return found

    def close(self) -> None:
        """End a look that is at work."""
        self._closing = True
        process = self._process
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()
        if self._worker is not None:
            self._worker.close(1.0)

    # --- in its thread --------------------------------------------------------------------------------------------

    def _look(self, task: _Task) -> None:
        try:
            answer = self._answer(task)
            if task.run == self._run and not self._closing:
                self._used_s = (self._used_s or 0.0) + float(answer["used_s"]) - task.most_s
                self._take(answer["seen"], task.moment)
        except Exception as error:
            if not (self._failed or self._closing):
                self._failed = True
                why = str(error) or type(error).__name__
                words = f"the early look after {task.moment} {why}; the run goes on without what it would have found"
                self._events.append(Emerging("look", "", words))

    def _answer(self, task: _Task) -> Mapping[str, Any]:
        """The answer of a process. Raises RuntimeError, with words, if there is none."""
        command = [*self.command, str(task.run), f"{task.most_s:.0f}"]
        environment = {**os.environ, **ONE_THREAD}
        pipes: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        pipes["start_new_session"] = True  # an interrupt from the terminal is for the controller
        with subprocess.Popen(command, env=environment, **pipes) as process:
            self._process = process
            try:
                told, said = process.communicate(timeout=_REAL_S)
            except subprocess.TimeoutExpired:
                process.kill()
                raise RuntimeError("was ended, because it took more than an hour") from None
            finally:
                self._process = None
        if process.returncode < 0:
            raise RuntimeError(
                f"was ended by signal {-process.returncode}; it may take {task.most_s:.0f} s of a processor"
            )
        if process.returncode:
            last = said.decode(errors="replace").strip().splitlines()[-1:] or ["no reason given"]
            raise RuntimeError(f"failed ({last[0][:200]})")
        answer: Mapping[str, Any] = json.loads(told)
        return answer

    def _take(self, seen: Sequence[Mapping[str, Any]], moment: str) -> None:
        """Warn of what is there for the first time, or what fewer causes explain than before."""
        level = _LEVEL / max(1, len(self._moments))
        for one in seen:
            if one["p"] is not None and one["p"] > level and not one["bound"]:
                continue
            names, key = list(one["names"]), tuple(sorted(one["names"]))
            since = next((self._since[name] for name in names if name in self._since), moment)
            for name in names:
                self._since.setdefault(name, since)
            if key in self._told:
                continue
            self._told.add(key)
            size = "" if one["size"] is None else f", {one['size']:.1f} of the scatter"
            words = (
                f"{' or '.join(names)} in {', '.join(one['sensors'])}, since {since}{size} (trace of the run so far)"
            )
            self._events.append(Emerging("look", one["sensors"][0], f"emerging: {words}"))


def _moments(replications: Sequence[int]) -> dict[int, str]:
    """Index of the last point of each replication but the last one, and words for it; quarters of a single one."""
    ends = {number: index for index, number in enumerate(replications)}
    if len(ends) > 1:
        last = max(ends)
        return {index: f"replication {number}" for number, index in ends.items() if number != last}
    quarters = [len(replications) * k // 4 - 1 for k in (1, 2, 3)]
    return {index: f"point {index + 1}" for index in quarters if index > 0}
