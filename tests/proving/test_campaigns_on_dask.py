"""Campaigns on a Dask cluster: a scheduler and two workers of its own, over TCP on this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
import toys
from command import rig

from proving.executor import Dask, WorkersDie
from proving.frame import main as statistics
from proving.seeds import Campaign, Place

pytest.importorskip("distributed", reason="pip install -c constraints.txt -e '.[dask]'")

ROOT = Path(__file__).parents[2]
PATHS = os.pathsep.join([str(ROOT / "tests" / "support"), str(Path(__file__).parent), str(ROOT)])


def wait_for_both(address):
    """A worker that was killed is started again, which takes seconds on a busy machine."""
    from distributed import Client  # noqa: PLC0415 - an extra

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """The address of a scheduler with two workers, started as proving/notes/campaigns.md says."""
    folder = tmp_path_factory.mktemp("dask")
    # a worker that is killed is begun again: from a process that has imported what it needs, not from nothing
    forked = {"DASK_DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD": "forkserver"}
    environment = {**os.environ, "PYTHONPATH": PATHS, **forked}
    dask = [sys.executable, "-m", "dask"]

    def start(*command):
        with (folder / command[0]).open("w") as log:
            options = {"stdout": log, "stderr": log, "env": environment, "cwd": folder}
            return subprocess.Popen([*dask, *map(str, command)], **options)

    found = folder / "scheduler.json"
    one = start("scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard", "--scheduler-file", found)
    address = None
    workers = None
    try:
        end = time.monotonic() + 60  # noqa: TID251 - other processes in real time
        while address is None:
            assert one.poll() is None, (folder / "scheduler").read_text()
            assert time.monotonic() < end, "no scheduler"  # noqa: TID251
            time.sleep(0.05)  # noqa: TID251
            if found.exists() and found.read_text().endswith("}"):
                address = json.loads(found.read_text())["address"]
        workers = start("worker", address, "--nworkers", 2, "--nthreads", 2, "--no-dashboard", "--host", "127.0.0.1")
        wait_for_both(address)
        yield address
    finally:
        for process in (workers, one):
            if process is not None:
                process.terminate()
                process.wait(30)


def test_nights_on_a_cluster_come_to_the_same_as_here(scheduler):
    command = ("night", "--brief", "--lab", "attitude", "--seeds", 10, "--json")
    there = rig(*command, "--scheduler", scheduler)
    assert there.returncode == 0, there.stderr
    assert json.loads(there.stdout) == json.loads(rig(*command, "--jobs", 1).stdout)


def test_statistics_on_a_cluster_come_to_the_same_as_here(scheduler, capsys):
    command = ("gross-errors", "--seeds", "20", "--only", "12 rows", "--json")

    def told(*where: str) -> dict:
        assert statistics((*command, *where)) == 0
        return json.loads(capsys.readouterr().out)

    assert told("--scheduler", scheduler) == told("--jobs", "1")


def test_a_block_whose_worker_is_killed_on_a_cluster_is_done_again(scheduler, tmp_path):
    campaign = Campaign(partial(toys.dies_once, folder=tmp_path), "toys", block=2)
    with Place.open(1, scheduler, tmp_path / "ledger") as place:
        assert list(place.results(campaign, range(3, 13))) == [(seed, toys.square(seed)) for seed in range(3, 13)]
    assert sorted(int(path.name) for path in tmp_path.glob("[0-9]*")) == [3, 6, 9, 12]


def test_a_worker_of_a_cluster_does_one_thing_at_a_time(scheduler, tmp_path):
    """Each of the two has two threads."""
    wait_for_both(scheduler)
    campaign = Campaign(partial(toys.alone, folder=tmp_path), "toys", block=1)
    with Place.open(1, scheduler, None) as place:
        found = [result for _, result in place.results(campaign, range(12))]
    assert not any(result["others"] for result in found)
    assert len({result["process"] for result in found}) == 2


def test_where_no_scheduler_answers_it_is_said(monkeypatch):
    monkeypatch.setattr("proving.executor._CONNECT_S", 0.2)
    done = rig("night", "--brief", "--seeds", 1, "--scheduler", "tcp://127.0.0.1:9")
    assert done.returncode == 2
    assert "tcp://127.0.0.1:9" in done.stderr


def test_work_that_kills_every_worker_of_a_cluster_ends_in_words(scheduler, monkeypatch):
    monkeypatch.setattr("proving.executor.DEATHS", 1)
    with pytest.raises(WorkersDie), Place.open(1, scheduler, None) as place:
        list(place.results(Campaign(toys.dies, "toys"), range(2)))


def test_without_dask_it_is_said_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(Exception, match="needs Dask"):
        Dask("tcp://127.0.0.1:9")
