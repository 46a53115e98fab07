"""A campaign of brief nights whose workers are killed at random, and which itself is: does it come to the same?

    .venv/bin/python -m proving.killed_campaign --seeds 5000 [--every 4] [--seed 1] [--jobs 2]

Undisturbed first; then with a ledger, and SIGKILLs at random, `--every` seconds on average after something was added to
the ledger, every fourth also before that. Most are of a worker; one in `--whole` is of the campaign, which is started
again with the same command. Both must end with the same JSON, and so with the same digest.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.drivers.clock import RealClock


def main() -> int:
    """As the command line says; 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5000, help="nights")
    parser.add_argument("--every", type=float, default=4.0, help="seconds between kills, on average")
    parser.add_argument("--whole", type=int, default=5, help="one kill in so many is of the whole campaign")
    parser.add_argument("--seed", type=int, default=1, help="of the kills")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes")
    asked = parser.parse_args()
    stopwatch = RealClock().stopwatch
    command = ("night", "--brief", "--lab", "attitude", "--seeds", asked.seeds, "--jobs", asked.jobs, "--json")
    began = stopwatch()
    undisturbed = through(*command)
    between = stopwatch()
    with tempfile.TemporaryDirectory() as folder:
        ledger = Path(folder) / "ledger"
        killer = Killer(asked.seed, asked.every, asked.whole, ledger)
        disturbed = through(*command, "--ledger", ledger, meanwhile=killer.kill)
    same = undisturbed == disturbed
    print(
        f"{asked.seeds} nights in {between - began:.0f} s; in {stopwatch() - between:.0f} s with "
        f"{killer.kills['worker']} workers and {killer.kills['campaign']} campaigns killed (kills of seed {asked.seed})"
    )
    for name, found in (("undisturbed", undisturbed), ("disturbed", disturbed)):
        print(f"{name:12s} {found['attitude']['nights']} nights, digest {found['attitude']['digest']}")
    print("the same" if same else f"NOT the same: {undisturbed} and {disturbed}")
    return 0 if same else 1


def through(*arguments: object, meanwhile: Callable[[int], None] = lambda _: None) -> dict[str, Any]:
    """What a command of `rig` prints as JSON, started again as often as it is killed.

    Args:
        arguments: of it.
        meanwhile: called with its process id every twentieth of a second.

    """
    command = [sys.executable, "-m", "rig", *map(str, arguments)]
    while True:
        # Not to pipes: workers that outlive a killed campaign for a moment would hold them open.
        with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as told:
            process = subprocess.Popen(command, stdout=said, stderr=told)
            while process.poll() is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(0.05)
                    break
                meanwhile(process.pid)
            for file in (said, told):
                file.seek(0)
            if process.returncode == 0:
                result: dict[str, Any] = json.load(said)
                return result
            if process.returncode != -signal.SIGKILL:
                raise RuntimeError(f"exit {process.returncode}: {told.read()}")


@dataclass
class Killer:
    """Kills a campaign and its workers at random.

    Attributes:
        seed: of what it does.
        every_s: seconds, on average, from something new in the ledger to the next kill.
        whole: one kill in so many is of the campaign.
        ledger: of the campaign.
        kills: how many so far.

    """

    seed: int
    every_s: float
    whole: int
    ledger: Path
    kills: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._rng = random.Random(self.seed)
        self._stopwatch = RealClock().stopwatch
        self._next()

    def _next(self) -> None:
        self._seen = self._changed() if self._rng.random() < 0.75 else -1
        self._at = self._rng.expovariate(1.0 / self.every_s)
        self._since: float | None = None
        self._whole = self._rng.randrange(self.whole) == 0

    def _changed(self) -> int:
        return self.ledger.stat().st_mtime_ns if self.ledger.exists() else 0

    def kill(self, campaign: int) -> None:
        """Kill one of its processes, if it is time."""
        if self._since is None and self._changed() != self._seen:
            self._since = self._stopwatch()
        if self._since is None or self._stopwatch() - self._since < self._at:
            return
        victims = [campaign] if self._whole else workers(campaign)
        if not victims:
            return  # they are still being started
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._rng.choice(victims), signal.SIGKILL)
            self.kills["campaign" if self._whole else "worker"] += 1
        self._next()


def workers(campaign: int) -> list[int]:
    """Process ids of a campaign's workers: its grandchildren, for a server that it starts first forks them."""
    return [worker for server in children(campaign) for worker in children(server)]


def children(parent: int) -> list[int]:
    """Process ids of a process's children."""
    try:
        threads = list(Path(f"/proc/{parent}/task").iterdir())
        return [int(child) for thread in threads for child in (thread / "children").read_text().split()]
    except FileNotFoundError:
        return []


if __name__ == "__main__":
    sys.exit(main())
