"""Hold a run file against the tape of the bench it was measured on. Shares no code with the project.

Reads the run file with SQL of its own and the tape line by line; knows both only from their documents. The standard
library is all it needs.

python -m proving.chaos.checker RUN.sqlite BENCH.tape
"""

from __future__ import annotations

import bisect
import json
import math
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path

from proving.chaos.tape import Reading, Row, Run, Server, Tape, by_utc, found_among, numbers, quantities

KINDS = ("lost", "doubled", "wrong", "stays", "holes")
"""Points not observed, or observed and gone; observed twice; not as on the tape; not one stay; holes not recorded."""

_HOLE_S, _TURN_S = 10.0, 0.2
"""The documented rule: a hole is longer than 10 s and five times what a process of a busy machine may wait (0.2 s)."""
_BUILT_ON = ("accepted", "whole-plot", "environment-settled")
"""Records before which a hole must have been noticed."""
_SLACK_S = 0.1
"""Real seconds: how far apart a question and what is recorded of it may be."""


@dataclass
class Verdict:
    """What a checker found.

    Attributes:
        findings: sentences by kind.
        counts: what was looked at.

    """

    findings: dict[str, list[str]] = field(default_factory=lambda: {kind: [] for kind in KINDS})
    counts: Counter[str] = field(default_factory=Counter)

    def say(self, kind: str, words: str) -> None:
        """Add a finding."""
        self.findings[kind].append(words)

    @property
    def clean(self) -> bool:
        """Whether nothing was found."""
        return not any(self.findings.values())


class Checker:
    """Judges one run.

    Args:
        run: its file.
        tape: of the bench.
        outages: when instruments could not be reached, by the bench clock; begins and ends.

    """

    def __init__(self, run: Run, tape: Tape, outages: Iterable[tuple[float, float]] = ()) -> None:
        self._run, self._tape, self._outages = run, tape, list(outages)
        self._verdict = Verdict()
        self._seen: dict[int, tuple[float, float, set[int]]] = {}
        self._by_utc: dict[int, Server] = {}
        self._by_utc = {s: server for s in run.sessions if (server := self._counted_by_utc(s))}

    def check(self, ledger: dict[tuple[int, int], str] | None = None) -> Verdict:
        """Everything.

        Args:
            ledger: observations that once stood accepted in the file, from before it was tampered with.

        """
        counts = self._verdict.counts
        counts["points"], counts["observations"] = len(self._run.points), len(self._run.accepted)
        self._check_plan()
        self._check_ledger(ledger or {})
        for row in self._run.accepted:
            self._check_observation(row)
        self._check_order()
        if self._run.whole_plots:
            self._check_stays()
        else:
            self._check_prepared()
        self._check_holes()
        return self._verdict

    # --- the plan: every point once ---------------------------------------------------------------------------

    def _check_plan(self) -> None:
        run, say = self._run, self._verdict.say
        if not any(r.kind == "end" for r in run.rows):
            say("lost", "the run is not complete")
        skipped = {r.run_index for r in run.rows if (r.kind, r.status) == ("skip", "final")}
        planned_of, lost = self._plots()
        pairs = Counter((r.whole_plot or 0, r.run_index) for r in run.accepted)
        for (plot, index), times in pairs.items():
            if times > 1:
                say("doubled", f"point {index} of whole plot {plot}: {times} observations")
        kept = Counter(r.run_index for r in run.accepted if (r.whole_plot or 0) not in lost)
        for index, (plot, *_) in run.points.items():
            if not kept[index] and index not in skipped:
                say("lost", f"point {index} was never observed, and nothing says so")
            plots = {r.whole_plot for r in run.accepted if r.run_index == index and (r.whole_plot or 0) not in lost}
            if len(plots) > 1:
                say("doubled", f"point {index} is kept in whole plots {sorted(plots, key=str)}")
            if plot is not None and any(planned_of.get(p) != plot for p in plots):
                say("wrong", f"point {index} belongs to planned plot {plot}, not to that of {plots}")

    def _plots(self) -> tuple[dict[int | None, int], set[int]]:
        """Planned whole plot by identity; identities that were given up."""
        events = [r for r in self._run.rows if r.kind == "event"]
        planned = {r.whole_plot: int(r.body["planned"]) for r in events if r.status == "whole-plot"}
        return planned, {r.whole_plot or 0 for r in events if r.status == "whole-plot-lost"}

    def _check_ledger(self, ledger: dict[tuple[int, int], str]) -> None:
        now = {(r.run_index or 0, r.whole_plot or 0): json.dumps(r.body) for r in self._run.accepted}
        self._verdict.counts["ledger"] = len(ledger)
        for (index, plot), body in ledger.items():
            if (index, plot) not in now:
                self._verdict.say("lost", f"point {index} of plot {plot} was accepted once and is gone without a word")
            elif now[index, plot] != body:
                self._verdict.say("wrong", f"point {index} of plot {plot} is not what was accepted")

    # --- clocks -------------------------------------------------------------------------------------------------

    def _counted_by_utc(self, session: int) -> Server | None:
        """Of a session whose clock was not the machine's, as in a time namespace: by which server its UTC counts.

        What was read tells; where nothing was, whichever clock has a question on the tape at its begin.
        """
        first = self._run.sessions[session]
        by_clock, ends = self._at(first), [s.zero for s in self._tape.servers[1:]] + [math.inf]
        each = zip(self._tape.servers, ends, strict=True)
        servers = [s for s, end in each if s.zero <= by_utc(s, first, first.elapsed_s) < end]
        if any(abs(by_clock - by_utc(s, first, first.elapsed_s)) < self._tape.speed for s in servers):
            return None
        read = next((r for r in self._run.accepted if r.session == session), None)
        if read is not None and not self._fits(read, self._at):
            return next((s for s in servers if self._fits(read, partial(by_utc, s))), None)
        if read is not None or self._near(by_clock):
            return None
        return next((s for s in servers if self._near(by_utc(s, first, first.elapsed_s))), None)

    def _fits(self, row: Row, clock: Callable[[Row, float], float]) -> bool:
        begin, end = (clock(row, t) for t in row.body["measured_s"])
        slack = self._slack_s
        found = (
            found_among(self._tape.readings[s], v, k, begin - slack, end + slack)
            for _, s, k, v in self._run.sources(row)
        )
        return all(part is not None for part in found)

    def _near(self, at: float) -> bool:
        place = bisect.bisect_left(self._tape.asked, at - self._tape.speed)
        return place < len(self._tape.asked) and self._tape.asked[place] < at + 3 * self._tape.speed

    @property
    def _slack_s(self) -> float:
        return 0.002 * self._tape.speed + 0.01

    def _at(self, row: Row, elapsed_s: float | None = None) -> float:
        """The bench clock at a record, or at another moment of its session."""
        session = self._run.sessions[row.session]
        elapsed_s = row.elapsed_s if elapsed_s is None else elapsed_s
        if row.session not in self._by_utc:
            return float(session.body["clock_s"] + elapsed_s - session.body["elapsed_s"])
        return by_utc(self._by_utc[row.session], row, elapsed_s)

    # --- one observation -------------------------------------------------------------------------------------

    def _check_observation(self, row: Row) -> None:
        for what, channel in quantities(row):
            readings = channel["readings"]
            mean = math.fsum(readings) / len(readings)
            if not math.isclose(mean, channel["mean"], rel_tol=1e-9, abs_tol=1e-12):
                self._wrong(row, f"the mean of {what} is {channel['mean']!r}, of its readings {mean!r}")
        begin, end = (self._at(row, t) for t in row.body["measured_s"])
        slack = self._slack_s * (20 if row.session in self._by_utc else 1)
        matched: list[Reading] = []
        for what, source, scale, values in self._run.sources(row):
            found = found_among(self._tape.readings[source], values, scale, begin - slack, end + slack)
            if found is None:
                self._wrong(row, f"{what} = {values} is not on the tape when it was read")
            else:
                matched += found
                self._verdict.counts["readings"] += len(found)
        if not matched:
            return
        first, last = min(r.begin for r in matched), max(r.end for r in matched)
        self._seen[row.seq] = first, last, {int(r.line["stay"]) for r in matched}
        self._check_references(row, begin - slack, end + slack)
        self._check_truth(row, matched)
        self._check_chambers(row, first)
        self._check_readback(row, last)

    def _wrong(self, row: Row, words: str) -> None:
        self._verdict.say("wrong", f"record {row.seq}, point {row.run_index}: {words}")

    def _check_references(self, row: Row, begin: float, end: float) -> None:
        for column, channel in row.body.get("references", {}).items():
            tape = self._tape.readbacks[self._run.bench["factors"][column]]
            if found_among(tape, channel["readings"], 1.0, begin, end) is None:
                self._wrong(row, f"{column} = {channel['readings']} was not read back then, by the tape")

    def _check_truth(self, row: Row, matched: list[Reading]) -> None:
        """What was truly set when it was read is what the plan wanted, reached from its side."""
        _, setpoints, sides = self._run.points[row.run_index or 0]
        for (name, _, hard), setpoint, side in zip(self._run.factors, setpoints, sides, strict=True):
            if hard:
                continue
            off = max(abs(r.line["factors"][name] - setpoint) for r in matched)
            if off > 0.01:
                self._wrong(row, f"{name} was {off:g} off its setpoint {setpoint:g}, by the tape")
            if side and any(r.line["sides"].get(name, side) != side for r in matched):
                self._wrong(row, f"{name} was not reached from its side ({side:+d}), by the tape")

    def _check_chambers(self, row: Row, at: float) -> None:
        first = max((r for rs in self._tape.readings.values() for r in rs if r.begin <= at), key=lambda r: r.begin)
        for name, state in row.body["environment"].items():
            air = first.line["air_degC"].get(name)
            if air is not None and abs(air - state["temperature_degC"]) > 0.2:
                self._wrong(row, f"{name} read {state['temperature_degC']:g} degC, its air was at {air:g}")
            set_to = self._setpoint(name, at)
            if set_to is not None and abs(set_to - state["setpoint_degC"]) > 0.05:
                self._wrong(row, f"{name} is recorded at setpoint {state['setpoint_degC']:g}, the tape has {set_to:g}")
            target = self._target(name, row)
            if target is not None and abs(target - state["setpoint_degC"]) > 0.05:
                self._wrong(row, f"{name} was set to {state['setpoint_degC']:g} degC, the plan says {target:g}")

    def _setpoint(self, chamber: str, at: float) -> float | None:
        for t, change in reversed(self._tape.changes):
            if t <= at and (change["on"], change["of"]) == (chamber, "setpoint_degC"):
                return float(change["value"])
        return None

    def _target(self, chamber: str, row: Row) -> float | None:
        _, setpoints, _ = self._run.points[row.run_index or 0]
        of = self._run.bench.get("factors", {})
        for (name, _, hard), setpoint in zip(self._run.factors, setpoints, strict=True):
            if hard and of.get(name) == chamber:
                return float(setpoint)
        return None

    def _check_readback(self, row: Row, last: float) -> None:
        """An angle read back was answered by the head, as text, between the last reading and the record."""
        end = self._at(row) + _SLACK_S * self._tape.speed
        for name, value in row.body["readback"].items():
            if name in row.body.get("references", {}):
                continue
            texts = [t for answers in self._tape.answers.values() for at, t in answers if last <= at <= end]
            if not any(value == number for text in texts for number in numbers(text)):
                self._wrong(row, f"{name} = {value!r} was read back by nobody, by the tape")

    def _check_order(self) -> None:
        times = [(self._seen[r.seq], r) for r in self._run.accepted if r.seq in self._seen]
        for (before, _), (after, row) in pairwise(times):
            if after[0] < before[1]:
                self._wrong(row, "was read before the observation that is recorded before it")

    # --- stays and holes ---------------------------------------------------------------------------------------

    def _check_stays(self) -> None:
        run, tape, say = self._run, self._tape, self._verdict.say
        gap = float(run.procedure.get("recovery", {}).get("continue_gap_s", 600.0))
        chambers = [run.bench["factors"][name] for name, _, hard in run.factors if hard]
        plots: dict[int, list[Row]] = defaultdict(list)
        for row in run.accepted:
            if row.seq in self._seen:
                plots[row.whole_plot or 0].append(row)
        for plot, rows in plots.items():
            first, last = self._seen[rows[0].seq][0], self._seen[rows[-1].seq][1]
            self._verdict.counts["plots"] += 1
            stays = set().union(*(self._seen[r.seq][2] for r in rows))
            if len(stays) > 1:
                say("stays", f"whole plot {plot} was read in {len(stays)} stays of the chambers, by the tape")
            if any(first < s.zero < last for s in tape.servers):
                say("stays", f"whole plot {plot} spans a new bench")
            for at, change in tape.changes:
                if first < at < last and change["of"] == "setpoint_degC" and change["on"] in chambers:
                    before = self._setpoint(change["on"], at - 1e-6)
                    if before is None or abs(before - change["value"]) > 0.05:
                        say("stays", f"whole plot {plot}: {change['on']} was set to {change['value']:g} within it")
            for chamber in chambers:
                asked = [t for t in tape.asked_of[chamber] if first <= t <= last]
                for a, b in tape.quiet([first, *asked, last], gap + _SLACK_S * tape.speed):
                    say("stays", f"whole plot {plot}: nobody looked at {chamber} for {b - a:.0f} s within it")

    def _check_prepared(self) -> None:
        """After a long hole the environment was settled again before the next observation."""
        run, tape = self._run, self._tape
        gap = float(run.procedure.get("recovery", {}).get("max_gap_s", 1800.0))
        prepared = [self._at(r) for r in run.rows if (r.kind, r.status) == ("event", "prepared")]
        seen = sorted(self._seen[r.seq] for r in run.accepted if r.seq in self._seen)
        for a, b in tape.quiet(tape.asked, gap + _SLACK_S * tape.speed):
            if self._explained(a, b):
                continue
            following = next((s for s in seen if s[0] >= b), None)
            if following and not any(b <= t <= following[0] for t in prepared):
                self._verdict.say("holes", f"{b - a:.0f} s alone, then read on without settling the environment again")

    def _check_holes(self) -> None:
        """A long silence of a controller that lived on is an event; one between two sessions is a gap."""
        run, tape, say = self._run, self._tape, self._verdict.say
        limit = _HOLE_S + 5.0 * _TURN_S * tape.speed + self._longest_wait_s()
        times = [(self._at(r), r) for r in run.rows if r.session in run.sessions]
        begun = sorted((t, r) for t, r in ((self._at(r), r) for r in run.sessions.values()))
        starts = [t for t, _ in begun]
        slack = _SLACK_S * tape.speed
        for a, b in tape.quiet(tape.asked, limit):
            if self._explained(a, b):
                continue
            self._verdict.counts["silences"] += 1
            place = bisect.bisect_right(starts, a + slack) - 1
            if place < 0:
                continue
            session = begun[place][1].session
            for row in run.accepted:
                begin, end, _ = self._seen.get(row.seq, (math.inf, -math.inf, None))
                if begin < a and b < end:
                    say("holes", f"record {row.seq}, point {row.run_index} was read over a hole of {b - a:.0f} s")
            own = [(t, r) for t, r in times if r.session == session]
            if not any(t > b + slack for t, _ in own):
                self._check_gap(begun, place, a, b)
                continue
            kept = [t for t, r in own if t > b + slack and r.status in _BUILT_ON]
            told = [r for t, r in own if r.status == "hole" and a - slack <= t <= min(kept, default=math.inf)]
            if not kept:
                continue  # it ended before anything was built on what it did not know
            if not told:
                say("holes", f"session {session}: a hole of {b - a:.0f} s at {a - starts[place]:.0f} s is no event")
            elif max(float(r.body["hole_s"]) for r in told) < 0.5 * (b - a) - self._longest_wait_s():
                say("holes", f"session {session}: a hole of {b - a:.0f} s is recorded as {told[0].body['hole_s']:g} s")

    def _explained(self, a: float, b: float) -> bool:
        """Whether a silence may be that of the instruments and not of the controller."""
        return self._tape.stalled(a, b) or any(begin < b and end > a for begin, end in self._outages)

    def _check_gap(self, begun: list[tuple[float, Row]], place: int, a: float, b: float) -> None:
        """The next session says how long it was alone, or that it does not know."""
        following = next(((t, r) for t, r in begun[place + 1 :] if t >= a), None)
        if following is None:
            return
        t, row = following
        last = max((self._at(r) for r in self._run.rows if r.seq < row.seq and r.session == row.session - 1), default=a)
        least = min(t, b) - max(a, last) - _SLACK_S * self._tape.speed
        if row.body["gap_known"] and row.body["gap_certain"] and row.body["gap_s"] < least:
            words = f"session {row.session} says {row.body['gap_s']:.0f} s, the tape has {least:.0f} s of silence"
            self._verdict.say("holes", words)

    def _longest_wait_s(self) -> float:
        """The longest that a controller of this procedure waits without a question."""
        p = self._run.procedure
        polls = [p.get(table, {}).get("poll_s", 30.0) for table in ("soak", "environment", "settle") if table in p]
        return max([30.0, *map(float, polls)]) + 30.0


def check(
    run: Path,
    tape: Path,
    ledger: dict[tuple[int, int], str] | None = None,
    outages: Iterable[tuple[float, float]] = (),
) -> Verdict:
    """Judge a run file by the tape of its bench; see `Checker`."""
    with tape.open(encoding="utf-8", errors="replace") as lines:
        return Checker(Run(run), Tape(lines), outages).check(ledger)


def main() -> int:
    """As the command line says; 1 if anything was found."""
    verdict = check(Path(sys.argv[1]), Path(sys.argv[2]))
    print(dict(verdict.counts))
    for kind, found in verdict.findings.items():
        print(f"{kind}: {len(found)}")
        for words in found[:20]:
            print(f"  {words}")
    return 0 if verdict.clean else 1


if __name__ == "__main__":
    sys.exit(main())
