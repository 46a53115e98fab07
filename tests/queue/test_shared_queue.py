"""A queue that machines share, in a PostgreSQL server of the system's packages."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from command import rig
from postgres import MISSING, Server
from small_run import write_small

from rig.database import Database
from rig.drivers.clock import RealClock
from rig.engine.session import Signals
from rig.errors import BusyError, ExitCode, RunFileError, StorageError, UsageError
from rig.examples import example
from rig.queue import Queue, work, worker
from rig.queue.shared import _WRITING, SharedQueue
from rig.run_file.events.queues import Queued, QueueEnded, QueuePaused

pytestmark = pytest.mark.skipif(MISSING is not None, reason=str(MISSING))

LAB = example("attitude-lab")
FAKE = """
import pathlib, sys, time
procedure, folder = sys.argv[2], pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
with open(pathlib.Path(__file__).with_name("begun"), "a") as begun:
    begun.write(folder.name + "\\n")
go = pathlib.Path(__file__).with_name("go")
while procedure == "wait" and not go.exists():
    time.sleep(0.01)
sys.exit(0)
"""


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server.made()
    yield server
    server.end()


@pytest.fixture
def url(server: Server, request: pytest.FixtureRequest) -> str:
    return server.database(request.node.name.split("[")[0].removeprefix("test_")[:60])


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A `rig` that notes in a file which item began, and ends at once, or waits for a file `go`."""
    path = tmp_path / "fake.py"
    path.write_text(FAKE)
    monkeypatch.setattr(worker, "RIG", (sys.executable, str(path)))
    monkeypatch.setattr(worker, "_POLL_S", 0.01)
    monkeypatch.setattr(worker, "_AWAY_S", 0.05)
    monkeypatch.setattr("rig.queue.shared._AGAIN_S", 0.01)
    return tmp_path / "begun"


def item(machine: str, procedure: str = "a.toml", bench: str = "/b.toml") -> Queued:
    return Queued(item=0, command="run", procedure=procedure, bench=bench, machine=machine)


def shared(url: str, folder: Path, machine: str = "one") -> SharedQueue:
    return SharedQueue(Database(url), machine, folder / "queue.sqlite")


def worked(file: SharedQueue, said: list[str] | None = None, **more: Any) -> Queue:
    told = said.append if said is not None else (lambda _: None)
    return work(file, RealClock(), has=frozenset(), signals=Signals(), said=told, stay=False, **more)


def test_each_machine_carries_out_its_own_items(url: str, server: Server, tmp_path: Path, begun: Path):
    one, two = shared(url, tmp_path / "1"), shared(url, tmp_path / "2", "two")
    assert one.read().items == {}
    one.append(item("one"), item("two"), item("two", bench="/c.toml"))
    assert [found.state for found in worked(two).items.values()] == ["waiting", "done", "done"]
    assert [found.state for found in worked(one).items.values()] == ["done"] * 3
    assert sorted(begun.read_text().split()) == ["queue-1", "queue-2", "queue-3"]
    # by another program
    database = url.split("/")[3].partition("?")[0]
    told = server.sql("SELECT body FROM rig_queue WHERE status = 'ended' ORDER BY seq", database).splitlines()
    assert [json.loads(line)["item"] for line in told][-1] == 1


def test_benches_of_one_name_on_two_machines_are_two(url: str, tmp_path: Path):
    one = shared(url, tmp_path)
    queue = one.append(item("one"), item("two"), QueueEnded(item=1, code=1))
    assert queue.held == {"one:/b.toml": 1}
    assert [found.number for found in queue.next(1e9, frozenset(), "two")] == [2]


def test_many_who_write_at_once_lose_and_double_nothing(url: str, tmp_path: Path):
    def added(k: int) -> list[int]:
        return [shared(url, tmp_path / str(k)).append(item("one")).added for _ in range(5)]

    with ThreadPoolExecutor(6) as every:
        numbers = [number for found in every.map(added, range(6)) for number in found]
    assert sorted(numbers) == list(range(1, 31))
    assert sorted(shared(url, tmp_path).read().items) == list(range(1, 31))


def test_two_workers_of_one_machine_never_begin_one_item(url: str, tmp_path: Path, begun: Path):
    first, other = shared(url, tmp_path / "1"), shared(url, tmp_path / "2")
    first.append(*[item("one", bench=f"/{k}.toml") for k in range(12)])
    with ThreadPoolExecutor(2) as every:
        assert all(every.map(worked, (first, other)))
    assert sorted(begun.read_text().split()) == sorted(f"queue-{k}" for k in range(1, 13))
    with first.only_worker(), pytest.raises(BusyError, match="carried out by another"):
        worked(first)


def test_while_the_server_is_gone_what_runs_goes_on_and_is_told_later(
    url: str, server: Server, tmp_path: Path, begun: Path
):
    file, said = shared(url, tmp_path), list[str]()
    file.append(item("one", "wait"), item("one"))
    with ThreadPoolExecutor(1) as every:
        ending = every.submit(worked, file, said)
        soon(begun.exists)
        server.stop()
        try:
            soon(lambda: any("cannot be reached" in words for words in said))
            (tmp_path / "go").touch()
            with pytest.raises(StorageError, match="cannot be reached") as refused:
                file.read()
            assert "secret" not in str(refused.value)
        finally:
            server.start()
        queue = ending.result(timeout=60)
    assert [found.state for found in queue.items.values()] == ["done", "done"]
    assert begun.read_text().split() == ["queue-1", "queue-2"]
    assert len([words for words in said if "cannot be reached" in words]) == 1


def soon(what: Any) -> None:
    """Wait for another process or thread, at most a minute."""
    done = threading.Event()
    for _ in range(6000):
        if what():
            return
        done.wait(0.01)
    raise AssertionError("a minute has passed")


def test_a_commit_without_an_answer_is_not_made_twice(
    url: str, tmp_path: Path, begun: Path, monkeypatch: pytest.MonkeyPatch
):
    broken, reached = [1], Database.reached

    @contextmanager
    def once_broken(self: Database, what: str) -> Iterator[Any]:
        with reached(self, what) as db:
            yield db
        if broken.pop(0) if broken else 0:
            raise StorageError("the answer was lost")

    monkeypatch.setattr(Database, "reached", once_broken)
    assert shared(url, tmp_path).append(item("one")).added == 1
    assert broken == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("UPDATE rig_queue SET body = replace(body, '/b', '/c') WHERE seq = 1", "record 1 of rig_queue"),
        ("UPDATE rig_queue SET utc_s = utc_s + 1 WHERE seq = 2", "record 2 of rig_queue"),
        ("DELETE FROM rig_queue WHERE seq = 1", "record 1 of rig_queue"),
        ("DELETE FROM rig_queue WHERE seq = 2", "lost its last records"),
        ("TRUNCATE rig_queue", "lost its last records"),
    ],
)
def test_a_table_that_was_changed_is_refused(
    change: str, words: str, server: Server, tmp_path: Path, request: pytest.FixtureRequest
):
    name = f"changed{request.node.name.count('DELETE')}{abs(hash(change))}"
    file = shared(server.database(name), tmp_path)
    file.append(item("one"), QueuePaused(on=True))
    server.sql(change, name)
    for do in (file.read, lambda: file.append(item("one"))):
        with pytest.raises(RunFileError, match=words):
            do()


def test_who_may_only_read_and_add_can_use_a_queue_and_waits_for_its_lock(
    url: str, server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    database = url.split("/")[3].partition("?")[0]
    shared(url, tmp_path).append(item("one"))
    server.sql("CREATE ROLE adder LOGIN; GRANT SELECT, INSERT ON rig_queue TO adder", database)
    adder = shared(url.replace("postgres:secret", "adder"), tmp_path / "adder")
    assert adder.append(item("one")).added == 2
    monkeypatch.setattr("rig.queue.shared.WAIT_S", 1)
    with Database(url).reached("a test") as other:
        other.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_WRITING})")
        with pytest.raises(BusyError, match="somebody else writes"):
            adder.append(item("one"))
    assert adder.append(item("one")).added == 3


def test_a_night_through_the_command_line(url: str, tmp_path: Path):
    env, queue = {"RIG_DATABASE": url}, tmp_path / "runs" / "queue.sqlite"
    add = ("queue", "add", write_small(tmp_path), "--bench", LAB / "bench.toml", "--dry", "--queue", queue)
    assert rig(*add, "--world", LAB / "world.toml", env=env).returncode == ExitCode.DONE
    there = rig("queue", "add", "/lab/a.toml", "--bench", "/lab/b.toml", "--machine", "bench-2", env=env, cwd=tmp_path)
    assert there.returncode == ExitCode.DONE
    assert "files of bench-2 cannot be checked here" in there.stderr
    done = rig("queue", "run", "--queue", queue, "--json", env=env)
    assert done.returncode == ExitCode.DONE, done.stderr
    assert sorted(found["state"] for found in json.loads(done.stdout)["items"]) == ["done", "waiting"]
    (run,) = (tmp_path / "runs" / "queue-1").glob("*.sqlite")
    assert run.exists()
    told = rig("queue", "list", env=env, cwd=tmp_path)
    assert "bench-2" in told.stdout
    assert "secret" not in told.stdout + told.stderr + done.stderr + there.stderr


@pytest.mark.parametrize(
    ("database", "words"),
    [
        ("mysql://lab/queue", "only postgresql://"),
        ("queue.sqlite", "an address such as"),
        ("postgresql://rig:secret@127.0.0.1:1/queue", "cannot be reached"),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_without_its_password(database: str, words: str, tmp_path: Path):
    done = rig("queue", "list", "--database", database, cwd=tmp_path)
    assert done.returncode in (ExitCode.USAGE, ExitCode.FAULT)
    assert words in done.stderr
    assert "secret" not in done.stderr
    with pytest.raises((UsageError, StorageError)):
        shared(database, tmp_path).read()
