"""A queue: the order of its items, its policies after faults, and its recovery after the death of its worker."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from command import rig
from small_run import write_small

from rig.drivers.clock import RealClock
from rig.engine.session import Signals
from rig.errors import ExitCode
from rig.examples import example
from rig.queue import Queue, QueueFile, work, worker
from rig.run_file.events.queues import QueueBegan, Queued, QueueEnded, QueueMoved, QueuePaused, QueueRemoved
from rig.run_file.live import controller_alive
from rig.run_file.verify.verification import verify_file

LAB = example("attitude-lab")
NOTHING: frozenset[str] = frozenset()


def item(procedure: str = "a.toml", bench: str = "b.toml", **more: Any) -> Queued:
    return Queued(item=0, command="run", procedure=procedure, bench=bench, **more)


@pytest.fixture
def file(tmp_path: Path) -> QueueFile:
    return QueueFile(tmp_path / "queue.sqlite")


def numbers(queue: Queue, utc_s: float = 1e9, has: frozenset[str] = NOTHING) -> list[int]:
    return [one.number for one in queue.next(utc_s, has)]


def test_one_of_a_bench_begins_by_priority_then_by_order(file: QueueFile):
    queue = file.append(item(), item(priority=3), item(bench="other.toml"))
    assert [one.number for one in queue.waiting] == [2, 1, 3]
    assert numbers(queue) == [2, 3]
    queue = file.append(QueueBegan(item=2))
    assert numbers(queue) == [3]
    queue = file.append(QueueEnded(item=2, code=0), QueueMoved(item=3, priority=-1), QueueRemoved(item=3))
    assert numbers(queue) == [1]


def test_an_item_waits_for_its_time_and_its_needs(file: QueueFile):
    queue = file.append(item(not_before_s=2e9), item(bench="c.toml", needs=["a person", "the 10 kN cell"]))
    assert numbers(queue) == []
    assert numbers(queue, utc_s=2e9) == [1]
    assert numbers(queue, has=frozenset({"a person"})) == []
    assert numbers(queue, has=frozenset({"a person", "the 10 kN cell"})) == [2]


@pytest.mark.parametrize(
    ("then", "code", "begins", "paused"),
    [
        ("go on", 1, [2, 3], False),
        ("hold", 1, [3], False),
        ("hold", 3, [3], False),
        ("hold", 0, [2, 3], False),
        ("go on", 4, [3], False),
        ("stop", 78, [], True),
    ],
)
def test_what_the_next_does_after_a_fault_is_declared(
    then: str, code: int, begins: list[int], paused: bool, file: QueueFile
):
    file.append(item(then=then), item(), item(bench="other.toml"))
    queue = file.append(QueueBegan(item=1), QueueEnded(item=1, code=code))
    assert (numbers(queue), queue.paused) == (begins, paused)
    assert numbers(file.append(QueuePaused(on=False))) == [2, 3]


def test_the_file_is_chained_and_verified_like_a_run_file(file: QueueFile):
    file.append(item())
    file.append(QueuePaused(on=True, why="a visitor"))
    assert file.read().paused
    found = verify_file(file.path)
    assert (found.whole, found.records) == (True, 3)


FAKE = """
import pathlib, sys
procedure, folder = sys.argv[2], pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
(folder / "begun").write_text("")
sys.exit(int(procedure))
"""


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A `rig` that ends at once, with the exit code that is the name of the procedure."""
    path = tmp_path / "fake.py"
    path.write_text(FAKE)
    monkeypatch.setattr(worker, "RIG", (sys.executable, str(path)))
    monkeypatch.setattr(worker, "_POLL_S", 0.01)
    return path


def worked(file: QueueFile, **more: Any) -> Queue:
    return work(file, RealClock(), has=NOTHING, signals=Signals(), said=lambda _: None, stay=False, **more)


def test_items_are_carried_out_and_a_fault_holds_their_bench(file: QueueFile, fake: Path):
    file.append(item("0"), item("1"), item("0"), item("0", bench="other.toml"))
    queue = worked(file)
    assert [one.state for one in queue.items.values()] == ["done", "fault", "waiting", "done"]
    assert queue.held == {"b.toml": 2}
    file.append(QueuePaused(on=False))
    assert worked(file).items[3].state == "done"


def test_an_item_that_is_interrupted_again_and_again_is_a_fault(file: QueueFile, fake: Path):
    file.append(item("75"))
    queue = worked(file)
    assert (queue.items[1].state, queue.items[1].begun) == ("fault", 5)


def test_an_item_of_a_dead_worker_is_looked_after(file: QueueFile, fake: Path):
    """Its process never made a file: it is begun again. While its process lives, it is left alone."""
    file.append(item("0"), QueueBegan(item=1))
    folder = file.path.with_name("queue-1")
    folder.mkdir()
    script = "import fcntl, sys; f = open(sys.argv[1], 'w'); fcntl.flock(f, 2); print(1, flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", script, str(folder / "lock")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        assert controller_alive(folder / "lock")
        looking = worker._Worker(file, NOTHING, Signals(), lambda _: None)
        looking.look(file.read().items[1])
        assert not (folder / "begun").exists()
        holder.communicate()
    assert worked(file).items[1].state == "done"
    assert (folder / "begun").exists()


def test_a_killed_queue_goes_on_and_nothing_is_done_twice(tmp_path: Path):
    """SIGKILL of the worker and of its run at once, as in a power cut; `rig queue run` resumes the run."""
    file = tmp_path / "queue.sqlite"
    add = ("queue", "add", write_small(tmp_path), "--bench", LAB / "bench.toml", "--dry", "--queue", file)
    for _ in range(2):
        assert rig(*add, "--world", LAB / "world.toml").returncode == 0
    command = [sys.executable, "-m", "rig", "queue", "run", "--queue", str(file)]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stderr is not None
        process.stderr.readline()
        os.killpg(process.pid, signal.SIGKILL)
    assert file_read(file)["at work"] == 1
    done = rig("queue", "run", "--queue", file, "--json")
    assert done.returncode == ExitCode.DONE, done.stderr
    told = json.loads(done.stdout)
    assert [one["state"] for one in told["items"]] == ["done", "done"]
    for number in (1, 2):
        (run,) = (tmp_path / f"queue-{number}").glob("*.sqlite")
        assert verify_file(run).whole


def file_read(path: Path) -> dict[str, int]:
    queue = QueueFile(path).read()
    return {"at work": len(queue.at_work), "waiting": len(queue.waiting)}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("add",), "needs a procedure file and --bench"),
        (("move", "7"), "7 is not the number of a waiting item"),
        (("add", "x.toml", "--bench", "y.toml"), "x.toml"),
    ],
)
def test_what_cannot_be_queued_is_refused(arguments: tuple[str, ...], words: str, tmp_path: Path):
    done = rig("queue", *arguments, "--queue", tmp_path / "queue.sqlite", cwd=tmp_path)
    assert done.returncode in (ExitCode.USAGE, ExitCode.CONFIGURATION)
    assert words in done.stderr or "y.toml" in done.stderr
