"""Campaigns of seeds: every seed counts once, whoever worked it out, whatever was killed meanwhile."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import traceback
from functools import partial
from pathlib import Path

import apsw
import pytest
import toys
from command import rig

from proving import executor, killed_campaign, seeds
from proving.crashes.kills import wait_for
from proving.disk import Crash, Disk
from proving.executor import Processes, WorkersDie
from proving.ledger import Ledger
from proving.seeds import Campaign, Digest, Place
from rig.errors import UsageError

SEEDS = range(3, 33)


def digest_of(campaign, place, wanted=SEEDS):
    digest = Digest()
    for seed, result in place.results(campaign, wanted):
        digest.add(seed, result)
    return str(digest)


EXPECTED = digest_of(Campaign(toys.square, "toys"), Place(Processes(1)))


@pytest.mark.parametrize(("jobs", "block"), [(1, 1), (1, 7), (2, 1), (2, 4), (3, 50)])
def test_results_come_in_order_with_one_digest_for_any_number_of_workers_and_any_blocks(jobs, block):
    campaign = Campaign(toys.square, "toys", block)
    results = list(Place(Processes(jobs)).results(campaign, SEEDS))
    assert [seed for seed, _ in results] == list(SEEDS)
    assert digest_of(campaign, Place(Processes(jobs))) == EXPECTED


def test_another_result_and_another_seed_are_another_digest():
    one, other = Digest(), Digest()
    one.add(1, {"a": 1.0})
    other.add(1, {"a": 1.0000000000000002})
    assert (
        len({str(one), str(other), EXPECTED, digest_of(Campaign(toys.square, "t"), Place(Processes(1)), range(3))}) == 4
    )


def test_a_block_whose_worker_is_killed_is_done_again(tmp_path):
    """Ten of the seeds kill the process that first gets them."""
    campaign = Campaign(partial(toys.dies_once, folder=tmp_path), "toys", block=2)
    with Ledger(tmp_path / "ledger") as ledger:
        assert digest_of(campaign, Place(Processes(2), ledger)) == EXPECTED
        assert len(ledger.done("toys", SEEDS)) == len(SEEDS)
    assert len(list(tmp_path.glob("[0-9]*"))) == 10


def test_work_that_kills_every_worker_ends_in_words(monkeypatch):
    monkeypatch.setattr(executor, "DEATHS", 3)
    with pytest.raises(WorkersDie, match="3 workers died one after another"):
        digest_of(Campaign(toys.dies, "toys"), Place(Processes(2)))


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_a_seed_raises_ends_the_campaign_and_what_was_done_is_kept(tmp_path, jobs):
    with Ledger(tmp_path / "ledger") as ledger:
        place = Place(Processes(jobs), ledger)
        digest_of(Campaign(toys.square, "toys"), place, range(3, 9))
        with pytest.raises(ZeroDivisionError, match="seed 9"):
            digest_of(Campaign(toys.fails, "toys"), place, range(3, 10))
        assert list(ledger.done("toys", SEEDS)) == list(range(3, 9))


MASTER = """
import sys
from functools import partial
from pathlib import Path
import toys
from proving.seeds import Campaign, Place

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    campaign = Campaign(partial(toys.counted, folder=folder / "marks"), "toys", block=2)
    with Place.open(2, None, folder / "ledger") as place:
        list(place.results(campaign, range(3, 33)))
"""


def test_a_killed_campaign_goes_on_where_it_was_and_its_workers_end(tmp_path):
    (tmp_path / "marks").mkdir()
    (tmp_path / "master.py").write_text(MASTER)
    paths = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, tmp_path / "master.py", tmp_path]
    master = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)
    wait_for(lambda: len(list((tmp_path / "marks").iterdir())) > 10, master)
    orphans = killed_campaign.workers(master.pid)
    assert len(orphans) == 2
    master.kill()
    master.communicate()
    with subprocess.Popen(["sleep", "60"]) as alive:
        wait_for(lambda: not any(Path(f"/proc/{worker}").exists() for worker in orphans), alive)
        alive.kill()
    marks = {path.name for path in (tmp_path / "marks").iterdir()}
    with Ledger(tmp_path / "ledger") as ledger:
        before = ledger.done("toys", SEEDS)
        assert 0 < len(before) < len(SEEDS)
        campaign = Campaign(partial(toys.counted, folder=tmp_path / "marks"), "toys", block=2)
        assert digest_of(campaign, Place(Processes(1), ledger)) == EXPECTED
    again = {path.name.partition("-")[0] for path in (tmp_path / "marks").iterdir() if path.name not in marks}
    assert again == {str(seed) for seed in SEEDS if seed not in before}


def test_a_ledger_takes_no_seed_twice_and_nothing_is_taken_out_of_it(tmp_path):
    with Ledger(tmp_path / "ledger") as ledger:
        ledger.begin("toys", "")
        ledger.add("toys", {1: {"a": 1}})
        with pytest.raises(apsw.ConstraintError):
            ledger.add("toys", {0: {}, 1: {"a": 2}})
        assert ledger.done("toys", range(9)) == {1: {"a": 1}}
    database = apsw.Connection(str(tmp_path / "ledger"))
    for statement in ("DELETE FROM result", "UPDATE result SET result = '{}'"):
        with pytest.raises(apsw.ConstraintError, match="append only"):
            database.execute(statement)


def test_a_ledger_belongs_to_one_campaign_at_a_time_and_to_one_state_of_the_program(tmp_path, monkeypatch):
    path = tmp_path / "ledger"
    with Ledger(path) as ledger:
        digest_of(Campaign(toys.square, "toys"), Place(Processes(1), ledger), range(5))
        with pytest.raises(UsageError, match="another campaign has this ledger open"):
            Ledger(path)
    monkeypatch.setattr(seeds, "source", lambda: "another")
    with Ledger(path) as ledger, pytest.raises(UsageError, match="begun with another state of the program"):
        digest_of(Campaign(toys.square, "toys"), Place(Processes(1), ledger), range(5))


def test_a_worker_with_another_state_of_the_program_is_refused(monkeypatch):
    monkeypatch.setattr(seeds, "source", lambda: "another")
    with pytest.raises(UsageError, match="a worker has another state of the program"):
        digest_of(Campaign(toys.square, "toys"), Place(Processes(2)))


def test_what_is_no_ledger_is_refused_and_left_alone(tmp_path):
    (tmp_path / "table.csv").write_text("a,b\n" * 500)
    done = rig("night", "--seeds", 1, "--brief", "--ledger", tmp_path / "table.csv")
    assert done.returncode == 2
    assert "not a ledger of a campaign" in " ".join(done.stderr.split())
    assert (tmp_path / "table.csv").read_text() == "a,b\n" * 500


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of connections to a disk that is gone
@pytest.mark.parametrize("lost", ["none", "all", "some"])
def test_a_power_cut_at_any_write_of_a_ledger_loses_no_block_that_was_added(tmp_path, lost):
    """On the simulated disk of the run file's own tests; a block is there as a whole or not at all."""
    crashes = 0
    for nth in range(1, 200):
        folder = tmp_path / str(nth)
        folder.mkdir()
        with contextlib.ExitStack() as before, Disk(seed=nth, default=True) as disk:
            added = set()
            disk.crash_at(nth)
            try:
                add_blocks(folder / "ledger", added, before)
            except (Crash, apsw.Error) as crash:  # the latter where rolling back fails as well
                assert disk.crashed
                crashes += 1
                disk.power_cut(lost)
                traceback.clear_frames(crash.__traceback__)  # with them goes a connection that was being opened
                with contextlib.suppress(apsw.IOError):
                    before.close()
            else:
                break
            with Ledger(folder / "ledger") as ledger:
                ledger.begin("toys", "")
                there = set(ledger.done("toys", range(99)))
            assert there in (added, added | {len(added), len(added) + 1})
    assert crashes > 20


def add_blocks(path, added, before):
    ledger = before.enter_context(Ledger(path))
    ledger.begin("toys", "")
    for seed in range(0, 8, 2):
        ledger.add("toys", {seed: {}, seed + 1: {}})
        added |= {seed, seed + 1}
    before.close()


def test_nights_whose_workers_are_killed_come_to_the_same(capsys, monkeypatch):
    """A share of `python -m proving.killed_campaign`, which kills the campaign as well."""
    options = ("--seeds", "16", "--every", "0.2", "--whole", "99", "--seed", "2")  # of that seed, the first comes early
    monkeypatch.setattr(sys, "argv", ["killed_campaign", *options])
    assert killed_campaign.main() == 0
    said = capsys.readouterr().out
    print(said)
    assert " 0 workers" not in said
    assert said.endswith("the same\n")


def test_a_campaign_that_is_done_is_told_from_its_ledger(tmp_path):
    command = ("night", "--brief", "--lab", "attitude", "--seeds", 3, "--jobs", 1, "--json")
    first = rig(*command, "--ledger", tmp_path / "ledger")
    again = rig(*command, "--ledger", tmp_path / "ledger")
    assert json.loads(first.stdout) == json.loads(again.stdout) == json.loads(rig(*command).stdout)
    assert json.loads(first.stdout)["attitude"]["nights"] == 3
