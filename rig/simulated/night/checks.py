"""What must hold after every night, held against the run file and against what truly happened.

Each check reads the file as anybody could and asks the witness; none asks the controller.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from procedures import Point, RunList
from rig.engine.chain import Record
from rig.engine.live import live_path
from rig.engine.run_reader import RunReader
from rig.engine.session import Outcome
from rig.errors import RunFileError
from rig.simulated.night.play import MOST_SESSIONS, Played


@dataclass(frozen=True)
class Violation:
    """Something that must not happen.

    Attributes:
        invariant: name of the check.
        what: what was found, and where.

    """

    invariant: str
    what: str


@dataclass
class _Night:
    """A night as the checks take it."""

    played: Played
    run_list: RunList
    records: list[Record]

    def accepted(self) -> Iterator[Record]:
        """Accepted observations."""
        return (r for r in self.records if r.kind == "observation" and r.status == "accepted")

    def point(self, record: Record) -> Point:
        """Where an observation was made."""
        assert record.run_index is not None
        return self.run_list.points[record.run_index]

    def world_s(self, session: int, elapsed_s: float) -> float:
        """World time of an elapsed time, by the clock reading that the session began with."""
        return elapsed_s + self._origins[session]

    def __post_init__(self) -> None:
        self._origins: dict[int, float] = {
            r.session: r.data["clock_s"] - r.data["elapsed_s"] for r in self.records if r.kind == "session"
        }


def judge(played: Played) -> list[Violation]:
    """Everything that does not hold; empty after a good night."""
    if played.path is None:
        return [Violation("complete", f"no run file after {len(played.sessions)} sessions: {played.sessions[-1]}")]
    try:
        with RunReader.open(played.path) as reader:
            reader.verify()
            night = _Night(played, reader.run_list(), list(reader.records()))
    except RunFileError as error:
        return [Violation("verifies", str(error))]
    return [Violation(name, what) for name, check in INVARIANTS.items() for what in check(night)]


def _complete(night: _Night) -> Iterator[str]:
    played = night.played
    if not played.complete:
        last = played.sessions[-1]
        yield f"not complete after {MOST_SESSIONS} sessions; the last was {last.how}: {last.message}"
    elif live_path(played.path).exists():  # type: ignore[arg-type]
        yield "the live state was left behind"


def _accounted(night: _Night) -> Iterator[str]:
    """Every point of the run list, in the whole plot that counts, once: observed, or given up for a stated reason."""
    observed, skipped = Counter[tuple[int, int | None]](), dict[int, str]()
    lost, planned = set[int](), dict[int, int]()
    for r in night.records:
        if r.kind == "observation" and r.status == "accepted":
            assert r.run_index is not None
            observed[r.run_index, r.whole_plot] += 1
        elif r.kind == "skip" and r.status == "final":
            assert r.run_index is not None
            skipped[r.run_index] = str(r.data.get("reason", ""))
        elif r.kind == "event" and r.status == "whole-plot":
            assert r.whole_plot is not None
            planned[r.whole_plot] = int(r.data["planned"])
        elif r.kind == "event" and r.status == "whole-plot-lost":
            assert r.whole_plot is not None
            lost.add(r.whole_plot)
            span = range(int(r.data["first"]), int(r.data["first"]) + int(r.data["count"]))
            for index in span:
                skipped.pop(index, None)
    if not night.played.complete:
        return
    for (index, identity), times in observed.items():
        if times > 1:
            yield f"point {index} was accepted {times} times in whole plot {identity}"
    for p in night.run_list.points:
        counts = [n for (index, identity), n in observed.items() if index == p.index and identity not in lost]
        if sum(counts) + (p.index in skipped) != 1:
            yield f"point {p.index} has {sum(counts)} accepted observations" + (
                " and was skipped" if p.index in skipped else ""
            )
        if p.index in skipped and not skipped[p.index]:
            yield f"point {p.index} was skipped without a reason"
    for identity, plan in planned.items():
        wrong = [i for (i, w) in observed if w == identity and night.run_list.points[i].whole_plot != plan]
        if wrong:
            yield f"point {wrong[0]} was observed in a measurement of whole plot {plan}, which is not its own"


_METER = 8e-7
"""What a meter of these benches may add to a reading, of its range: six standard deviations of its noise, a digit."""


def _truthful(night: _Night) -> Iterator[str]:
    """Every accepted reading is what the sensor truly gave then and there."""
    config = night.played.plan.bench
    wires = {f"{n}_{s.unit}": (s.reader, s.channel, 1e-3 if s.unit == "mV" else 1.0) for n, s in config.sensors.items()}
    digit = {name: _METER * float(i.options.get("range_V", 10.0)) for name, i in config.instruments.items()}
    witness = night.played.witness
    starts = {wire: [s.t_s for s in seen] for wire, seen in witness.readings.items()}
    for r in night.accepted():
        point = night.point(r)
        began, ended = (night.world_s(r.session, t) for t in r.data["measured_s"])
        if r.attempt != 1 or r.run_index == 0:  # what an attempt that failed has read here was as true
            began = _there_since(night, point, began)
        for column, output in r.data["outputs"].items():
            reader, channel, volts = wires[column]
            seen = witness.readings.get((reader, channel), [])
            at = bisect_left(starts.get((reader, channel), []), began - _CLOCK_S)
            known, there = None, None
            for value in output["readings"]:
                true = value * volts
                if value == known and there is not None:
                    continue  # a meter may hang for the rest of a point: what it repeats was true in this place
                while (
                    at < len(seen) and seen[at].t_s <= ended + _CLOCK_S and abs(seen[at].input - true) > digit[reader]
                ):
                    at += 1
                if at >= len(seen) or seen[at].t_s > ended + _CLOCK_S:
                    when = f"between {began:.1f} and {ended:.1f} s"
                    yield f"point {point.index}: {column} = {value:g} was never read {when}"
                    break
                known, there = value, seen[at]
                yield from _there(night, point, column, there.setting)
                at += 1


def _there_since(night: _Night, point: Point, began: float) -> float:
    """World time of the first reading before `began` from which on everything stood where a point wants it."""
    for seen in reversed(next(iter(night.played.witness.readings.values()))):
        if seen.t_s < began:
            if any(_there(night, point, "", seen.setting)):
                break
            began = seen.t_s
    return began


_CLOCK_S = 0.5


_THERE = {"deg": 0.003, "psia": 0.02}
"""How far the truth may be from the setpoint: band, encoder and reference errors and control noise."""


def _there(night: _Night, point: Point, column: str, setting: Mapping[str, float]) -> Iterator[str]:
    for factor, setpoint in zip(night.run_list.factors, point.setpoints, strict=True):
        if factor.hard:
            continue
        unit = factor.name.rpartition("_")[2]
        is_at = setting[factor.name.rpartition("_")[0]]
        if abs(is_at - setpoint) > _THERE[unit]:
            yield f"point {point.index}: {column} was read with {factor.name} at {is_at:g}, not at {setpoint:g}"


def _approached(night: _Night) -> Iterator[str]:
    """Every reading was taken where the axis had truly come from its planned side, from far enough."""
    witness = night.played.witness
    first = next(iter(night.played.plan.bench.sensors.values()))
    seen = witness.readings.get((first.reader, first.channel), [])
    times = [s.t_s for s in seen]
    for r in night.accepted():
        point = night.point(r)
        began = night.world_s(r.session, r.data["measured_s"][0])
        at = bisect_left(times, began - 1e-6)
        for factor, side, setpoint in zip(night.run_list.factors, point.sides, point.setpoints, strict=True):
            if not side or factor.hard:
                continue
            arrived, start = r.data["approach"].get(factor.axis, (0, setpoint))
            truly = seen[at].direction[factor.name.rpartition("_")[0]] if at < len(seen) else 0
            if arrived != side or truly not in (0, side):
                said = f"truly from side {truly}, recorded from {arrived}, planned from {side}"
                yield f"point {point.index}: {factor.axis} came {said}"
            elif (setpoint - start) * side < 0.9 * factor.overtravel:
                yield f"point {point.index}: {factor.axis} came from {start:g}, nearer than its overtravel"


def _one_stay(night: _Night) -> Iterator[str]:
    """Observations of one whole-plot identity share one stay at its temperatures; another identity is another stay."""
    if not night.run_list.hard:
        return
    witness, config = night.played.witness, night.played.plan.bench
    first = next(iter(config.sensors.values()))
    seen = witness.readings.get((first.reader, first.channel), [])
    times = [s.t_s for s in seen]
    stays: dict[int, set[int]] = {}
    for r in night.accepted():
        assert r.whole_plot is not None
        began = night.world_s(r.session, r.data["measured_s"][0])
        at = min(bisect_left(times, began - 1e-6), len(seen) - 1)
        stays.setdefault(r.whole_plot, set()).add(seen[at].whole_plot)
        setting = night.run_list.setting(night.point(r))
        for factor in night.run_list.hard:
            chamber = config.factors[factor.name]
            air = seen[at].air_degC[chamber]
            if abs(air - setting[factor.name]) > _AIR_DEGC:
                yield f"point {r.run_index}: {chamber} was truly at {air:.2f} degC, not {setting[factor.name]:g}"
    owners: dict[int, int] = {}
    for identity, truly in stays.items():
        if len(truly) > 1:
            yield f"whole plot {identity} has observations of {len(truly)} stays at its temperatures"
        for stay in truly:
            if owners.setdefault(stay, identity) != identity:
                yield f"whole plots {owners[stay]} and {identity} are one stay at one pair of temperatures"


_AIR_DEGC = 0.6


def _within_limits(night: _Night) -> Iterator[str]:
    limits = night.played.plan.bench.limits
    for quantity, (low, high) in night.played.witness.extremes.items():
        allowed = limits.get(quantity)
        if allowed and not (allowed[0] <= low and high <= allowed[1]):
            yield f"{quantity} was sent to {low:g} ... {high:g}, outside {allowed[0]:g} to {allowed[1]:g}"


def _safe(night: _Night) -> Iterator[str]:
    for ended in night.played.sessions:
        if ended.outcome is not Outcome.UNSAFE and ended.not_safe:
            yield f"the session that ended {ended.how} at {ended.ended_s:.0f} s left it so: {'; '.join(ended.not_safe)}"


def _in_order(night: _Night) -> Iterator[str]:
    """Elapsed time never runs backwards, whatever the clocks of the machine do."""
    before = 0.0
    for r in night.records:
        if r.elapsed_s < before - 1e-6:
            yield f"a {r.kind} at {r.elapsed_s:.3f} s follows one at {before:.3f} s"
            return
        before = r.elapsed_s


def _foreseen(night: _Night) -> Iterator[str]:
    """No session ends in an error that nobody foresaw."""
    for ended in night.played.sessions:
        if ended.how == "unforeseen":
            yield ended.message


def _left_alone(night: _Night) -> Iterator[str]:
    """Nothing is vented but at the end of a session, or before a new whole plot."""
    edges = [s.ended_s for s in night.played.sessions]
    for t in night.played.witness.vents:
        end = next((e for e in edges if e >= t), None)
        if end is None or end - t > _VENTING_S:
            yield f"the line was vented at {t:.0f} s, in the middle of a session"


_VENTING_S = 900.0


def _heeded(night: _Night) -> Iterator[str]:
    """Nothing is accepted while a chamber has been reporting an alarm for longer than interlocks may go unlooked at."""
    alarms = [
        (one.t_s, one.t_s + one.fault.for_s, one.what)
        for one in night.played.bench.sim.faults.happened
        if one.fault.kind == "chamber-alarm"
    ]
    ends = [until for _, until, _ in alarms]  # one that is over takes an earlier one's alarm with it
    for r in night.accepted():
        began = night.world_s(r.session, r.data["measured_s"][0])
        for since, until, what in alarms:
            over = min(end for end in ends if end > since)
            if since + _INTERLOCK_S < began < min(until, over):
                yield f"point {r.run_index} was accepted at {began:.0f} s: {what}"


_INTERLOCK_S = 90.0

INVARIANTS: Mapping[str, Callable[[_Night], Iterator[str]]] = {
    "complete": _complete,
    "accounted": _accounted,
    "truthful": _truthful,
    "approached": _approached,
    "one stay": _one_stay,
    "within limits": _within_limits,
    "safe": _safe,
    "in order": _in_order,
    "foreseen": _foreseen,
    "left alone": _left_alone,
    "heeded": _heeded,
}
