"""Long runs: memory a point, work a point, rows at a time. Counted, not timed; benchmarks/load.py has the seconds."""

from __future__ import annotations

import gc
import hashlib
import json
import random
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import ideal_bench
import pytest
from night_procedure import procedure

from rig.engine.queue import PointQueue
from rig.engine.session import Outcome, Signals
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.plan.run_list import Factor, Point, RunList, rows_sha256
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.run_file.chain import GENESIS, Record, followed, link
from rig.run_file.read.reader import RunReader
from rig.run_file.state.indexes import IndexCounts, IndexSet
from rig.run_file.state.state import RunState, fold
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter


def long_procedure(points: int) -> PitchRollProcedure:
    """100 attitudes, replicated."""
    design = {"type": "D1", "pitch_max_deg": 90, "pitch_count": 10, "roll_count": 10}
    return procedure(replications=points // 100, design=design)


def peak_bytes(work: Callable[[], object]) -> int:
    """Most memory that `work` has in use at once."""
    gc.collect()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def growth(work: Callable[[int], object], few: int, many: int) -> float:
    """Bytes a point by which memory grows with the number of points."""
    work(few)  # caches that fill once
    return (peak_bytes(lambda: work(many)) - peak_bytes(lambda: work(few))) / (many - few)


# --- the run list ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("run_list", "sha256"),
    [
        (procedure().expand(), "9b77b8df845e1ab9c8a59c762dd2d7fa558dc7a7d2a749fdf18edb175d7abdfe"),
        (
            procedure(order={"type": "random"}).expand(),
            "6bf780f41ca940ecac2a86fc2febe2dfc753b14dd5cee0d3cd8e3063db388182",
        ),
        (
            procedure(order={"type": "up-and-down"}, replications=5).expand(),
            "ae3ac00318215984f1822dcc340d5046c3930ade055e6d6c7a73d3fd0bf8765d",
        ),
        (
            WholePlotProcedure.model_validate(
                {"kind": "whole-plot", "name": "n", "seed": 152, "replications": 2}
            ).expand(),
            "fb853b3c3cfd814fd0935e39794656fa7130e3caf3c1264c73acf4114df478c5",
        ),
    ],
)
def test_a_packed_run_list_has_the_hash_that_stored_runs_were_made_with(run_list, sha256):
    """Run files of earlier versions hold these: another hash, and none of them could be resumed."""
    assert run_list.sha256() == sha256
    head = {
        "factors": [[f.name, f.axis, f.overtravel, f.hard, f.stays] for f in run_list.factors],
        "seed": run_list.seed,
    }
    text = json.dumps(head, sort_keys=True)
    text += "".join(json.dumps([p.index, p.replication, p.whole_plot, p.setpoints, p.sides]) for p in run_list.points)
    assert hashlib.sha256(text.encode()).hexdigest() == sha256


def test_points_come_out_of_a_run_list_as_they_went_in():
    rng = random.Random(5)
    points = [
        Point(i, 1 + i // 40, rng.choice([None, i // 7]), (rng.uniform(-9, 9), float(i % 3)), (rng.choice([-1, 1]), 0))
        for i in range(700)
    ]
    run_list = RunList((Factor("a_deg", "a"), Factor("b_deg", "b")), iter(points), 1)
    assert list(run_list.points) == points
    assert [run_list.points[i] for i in range(700)] == points
    assert run_list.points[-1] == points[-1]
    assert list(run_list.points[5:600:7]) == points[5:600:7]
    rows = [(p.index, p.replication, p.whole_plot, *p.setpoints, *p.sides) for p in points]
    slices = [rows[at : at + 90] for at in range(0, len(rows), 90)]
    assert rows_sha256(run_list.factors, 1, slices) == run_list.sha256() != rows_sha256(run_list.factors, 1, slices[1:])
    assert run_list.whole_plots == len({p.whole_plot for p in points} - {None})
    at = [p.index for p in points if p.whole_plot == 11]
    assert run_list.points.span(11) == (at[0], len(at))
    with pytest.raises(IndexError):
        run_list.points[700]
    with pytest.raises(ValueError, match="point 3 of the run list is numbered 4"):
        RunList((), (Point(i + (i > 2), 1, None, (), ()) for i in range(9)), 1)


def test_an_angle_of_minus_zero_can_be_stored(tmp_path):
    """Uniform angles round to -0.0 where the middle is missed by a hair; a run file keeps 0.0."""
    run_list = procedure(design={"type": "D1", "pitch_max_deg": 0.7, "pitch_count": 7, "roll_count": 3}).expand()
    create(tmp_path / "a.sqlite", Genesis("a", {}, run_list, True, {}), elapsed_s=0.0, utc_s=0.0)
    with RunReader.open(tmp_path / "a.sqlite") as reader:
        reader.verify()
        assert reader.run_list() == run_list


def test_expanding_checking_hashing_and_storing_take_a_few_bytes_a_point(tmp_path):
    def through(points: int) -> None:
        run_list = long_procedure(points).expand()
        assert len(run_list) == points
        assert not list(run_list.beyond({"pitch_deg": (-95, 95)}))
        run_list.extremes()
        path = tmp_path / f"{points}.sqlite"
        path.unlink(missing_ok=True)
        create(path, Genesis("a", {}, run_list, True, {}), elapsed_s=0.0, utc_s=0.0)
        with RunReader.open(path) as reader:
            reader.verify()

    assert growth(through, 500, 4000) < 20


# --- the state and the queue ----------------------------------------------------------------------------------------


def observed(index: int, attempt: int = 1, status: str = "accepted") -> Record:
    return Record(1, "observation", 1.0 * index, 1.0 * index, index, None, attempt, status)


def test_a_state_takes_a_few_bytes_a_point():
    kept: list[RunState] = []
    grown = growth(lambda n: kept.append(fold(observed(i) for i in range(n))), 2000, 14_000)
    assert grown < 5
    assert [len(state.accepted) for state in kept] == [2000, 14_000, 2000]


@pytest.mark.parametrize("seed", range(5))
def test_sets_and_counts_of_indexes_are_those_of_python(seed):
    rng = random.Random(seed)
    ours, theirs = IndexSet(), set[int]()
    counts, ordinary = IndexCounts(), dict[int, int]()
    for _ in range(3000):
        index = rng.choice([rng.randrange(100), rng.randrange(20_000), 2**62 + rng.randrange(9), -rng.randrange(9)])
        if rng.random() < 0.7:
            count = rng.choice([1, 2, 254, 255, 300, 0, -4])
            ours.add(index)
            theirs.add(index)
            counts[index] = ordinary[index] = count
        else:
            ours.discard(index)
            theirs.discard(index)
            assert counts.pop(index, None) == ordinary.pop(index, None)
        assert (index in ours) == (index in theirs)
    assert (ours, len(ours), list(ours)) == (theirs, len(theirs), sorted(theirs))
    assert dict(counts) == ordinary
    ours.difference_update(range(50))
    assert ours == theirs - set(range(50))
    assert ours.intersection(range(70)) == theirs & set(range(50, 70))


class ListedQueue:
    """The queue as a list of everything ahead: what it means, and what a million points cannot afford."""

    def __init__(self, run_list: RunList, state: RunState) -> None:
        self.points, self.state, self.deferred = run_list.points, state, list[Point]()
        self.refill()

    def refill(self) -> None:
        done = {*self.state.accepted, *self.state.skipped}
        self.ahead = [p for p in self.points if p.index not in done]
        self.deferred.clear()

    def pop(self) -> Point | None:
        if self.deferred and (not self.ahead or self.ahead[0].whole_plot != self.deferred[0].whole_plot):
            self.ahead = self.deferred + self.ahead
            self.deferred = []
        return self.ahead.pop(0) if self.ahead else None


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("whole_plots", [False, True])
def test_the_queue_gives_the_points_of_a_list_of_them(seed, whole_plots):
    rng = random.Random(seed)
    factor = Factor("a_deg", "a")
    points = (Point(i, 1, i // 8 if whole_plots else None, (0.0,), (1,)) for i in range(40))
    run_list, state = RunList((factor,), points, 0), RunState(points=40)
    for index in rng.sample(range(40), 9):
        state.accepted.add(index)
    state.skipped[rng.randrange(40)] = "broken"
    queue, listed = PointQueue(run_list, state), ListedQueue(run_list, state)
    late: set[int] = set()
    while True:
        peeked = queue.peek()
        point = queue.pop()
        assert point == peeked == listed.pop(), f"seed {seed}"
        if point is None:
            break
        fate = rng.random()
        if fate < 0.3 and point.index not in late:
            late.add(point.index)
            queue.put_off(point)
            listed.deferred.append(point)
        elif fate < 0.4:
            queue.put_back(point)
            listed.ahead.insert(0, point)
        elif fate < 0.45:
            first = 8 * (point.index // 8)
            state.accepted.difference_update(range(first, first + 8))  # the whole plot was lost
            queue.refill()
            listed.refill()
        else:
            state.accepted.add(point.index)
    assert len(state.accepted) == 40 - len(set(state.skipped) - set(state.accepted))


# --- the run file ---------------------------------------------------------------------------------------------------


def test_a_run_file_is_read_a_slice_at_a_time(tmp_path, monkeypatch):
    points = 3000
    path = ideal_bench.new_run(tmp_path, long_procedure(points))
    with RunWriter.open(path) as run:
        for i in range(points):
            run.append(observed(i), commit=i == points - 1)
    fetched: list[int] = []
    fetch = RunReader._all

    def counted(self: RunReader, statement: str, values: tuple[object, ...] = ()) -> list[Any]:
        rows = fetch(self, statement, values)
        fetched.append(len(rows))
        return rows

    monkeypatch.setattr(RunReader, "_all", counted)
    with RunReader.open(path) as reader:
        state = RunState()
        reader.verify(state.add)
        assert len(state.accepted) == points
        assert fold(reader.records()) == state
        assert sum(1 for _ in reader.records("observation")) == points
        assert reader.run_list() == long_procedure(points).expand()
    assert max(fetched) <= 200
    assert len(fetched) < 200  # records read four times and points twice, in slices: not a statement a row


def test_a_reader_between_two_slices_sees_what_was_added_and_holds_nothing_up(tmp_path):
    path = ideal_bench.new_run(tmp_path, long_procedure(1000))
    with RunWriter.open(path) as run, RunReader.open(path) as reader:
        for i in range(300):
            run.append(observed(i), commit=i == 299)
        records = reader.records("observation")
        seen = [next(records).run_index]
        run.append(observed(300))
        run.finish(Record(1, "end", 400.0, 400.0, status="complete"))
        assert path.with_name(path.name + "-wal").stat().st_size == 0  # nobody's transaction kept it
        assert seen + [r.run_index for r in records] == list(range(301))


def test_records_have_the_hashes_that_stored_runs_were_made_with():
    rng = random.Random(11)

    def word(plain: bool) -> str:
        kinds = [lambda: chr(rng.randrange(0x20, 0x7F)), lambda: '"']
        if not plain:
            kinds += [lambda: chr(rng.randrange(0x20)), lambda: "\\", lambda: chr(rng.choice([0x7F, 0xE9, 0x1F600]))]
        return "".join(rng.choice(kinds)() for _ in range(rng.randrange(12)))

    for i in range(2000):
        whole = rng.choice([None, 0, 7, 2**62])
        seconds = rng.choice([rng.random() * 1e9, 0.0, -0.0, 1e300, 3])
        record = Record(i, word(True), seconds, 1.5, whole, None, 1, rng.choice([None, word(False)]), word(i % 2 == 0))
        text = json.dumps([i, *record], separators=(",", ":"), allow_nan=False)
        assert link(GENESIS, i, record) == hashlib.sha256(GENESIS + text.encode()).digest(), record


@pytest.mark.parametrize("seed", range(3))
def test_rows_are_followed_as_far_as_their_links_hold(seed):
    """The short cut for plain records and `link` are of one mind, whatever is in a body."""
    rng = random.Random(seed)
    letters = ["a", "0", '"', "\\", "\n", "\t", "\x00", "\x7f", "é", "\U0001f600", "\ud800"]

    def row(seq: int, previous: bytes) -> list[Any]:
        body = "".join(rng.choices(letters[: rng.choice([4, 4, 11])], k=rng.randrange(9)))
        numbers = (rng.choice([None, 3]), rng.choice([None, 0, 2]), rng.choice([None, 1]))
        record = Record(1, "observation", rng.random() * 1e6, 3.25, *numbers, rng.choice([None, "accepted"]), body)
        return [seq, *record, previous, link(previous, seq, record)]

    rows: list[list[Any]] = []
    for seq in range(1, 400):
        rows.append(row(seq, rows[-1][11] if rows else GENESIS))
    assert followed([tuple(r) for r in rows], 1, GENESIS) == len(rows)
    assert followed([tuple(r) for r in rows], 2, GENESIS) == followed([tuple(r) for r in rows], 1, b"other") == 0
    for _ in range(600):
        at, column = rng.randrange(len(rows)), rng.randrange(12)
        here = rows[at]
        others = [None, 1, 1.0, "x", b"", float("inf"), 2**70, here[9] + rng.choice(letters), f'{here[9]}\\"']
        other = rng.choice(others)
        if other == here[column] and type(other) is type(here[column]):
            continue
        changed = (*here[:column], other, *here[column + 1 :])
        assert followed([changed], at + 1, here[10]) == 0, f"seed {seed}, record {at + 1}, column {column}: {other!r}"


def test_a_record_that_json_does_not_have_has_no_hash():
    for seconds in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="not JSON compliant"):
            link(GENESIS, 1, Record(1, "event", seconds, 0.0))


# --- the sequencer --------------------------------------------------------------------------------------------------


def lines_of_some_points(folder: Path, points: int, some: int) -> int:
    """Lines of our own code that run while `some` points of a run of so many are observed, set-up left out."""
    folder.mkdir()
    path = ideal_bench.new_run(folder, long_procedure(points))
    signals, lines = Signals(), 0
    own = str(Path(__file__).parents[2] / "rig")

    def count(frame: FrameType, what: str, _: Any) -> Any:
        nonlocal lines
        if what == "call":
            return count if frame.f_code.co_filename.startswith(own) else None
        lines += what == "line"
        return count

    def look(news: Any) -> None:
        if news.done >= 5 and sys.gettrace() is None:
            sys.settrace(count)
        if news.done >= 5 + some:
            sys.settrace(None)
            signals.interrupt = "SIGTERM"

    def noisy(_: Any, __: Any, reader: ideal_bench.IdealReader) -> None:
        reader.noise_V = 1e-6  # readings that never change are taken for frozen ones

    before = sys.gettrace()
    try:
        outcome, *_ = ideal_bench.run_session(
            path, procedure=long_procedure(points), signals=signals, on_progress=look, spoil=noisy
        )
    finally:
        sys.settrace(before)
    assert outcome is Outcome.INTERRUPTED
    return lines


def test_a_point_is_as_much_work_in_a_long_run_as_in_a_short_one(tmp_path):
    short, long = (lines_of_some_points(tmp_path / str(points), points, 12) for points in (100, 10_000))
    assert short > 1000
    assert long == pytest.approx(short, rel=0.02)
