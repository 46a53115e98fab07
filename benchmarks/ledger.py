"""Ratios of today beside the last ones on this kind of machine: what became slower, and by which functions.

    make bench                                  measure all of them (ten minutes on an idle machine)
    .venv/bin/python -m benchmarks.ledger NAME  measure some
    .venv/bin/python -m benchmarks.ledger --dry NAME  the same, and write nothing

Every measurement adds a line to benchmarks/ledger.jsonl: the ratio, the commit, the date, the machine, and where the
time goes by cProfile, in units of the peer's time. What is measured: benchmarks/ratios.py.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import platform
import pstats
import statistics
import tempfile
import time
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # ratios are per core

from benchmarks.figures import git
from benchmarks.ratios import RATIOS, Action, Pair, Ratio
from benchmarks.scratch import RUNS

LEDGER = Path(__file__).with_suffix(".jsonl")
LOSS = 1.10
"""A ratio above the last one times this is a loss."""
KEPT = 25
"""Functions of a profile that are kept."""
NAMED = 5
LEAST = 0.01
"""Share of our time below which the growth of a function is not named."""


@dataclass(frozen=True)
class Entry:
    """One measurement.

    Attributes:
        name: of the ratio.
        ratio: median of ours over median of the peer's.
        ours, peer: these medians, a unit each: seconds, or bytes.
        commit, date, machine: on what it was measured; a + marks code that was not committed.
        load: processes that wanted a core at the beginning, per core.
        profile: own time of functions, in units of the peer's time.

    """

    name: str
    ratio: float
    ours: float
    peer: float
    commit: str
    date: str
    machine: str
    load: float
    profile: dict[str, float] = field(default_factory=dict)


def machine() -> str:
    """Kind of machine: processor, cores, Python."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text().splitlines() if told.exists() else []
    model = next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine()
    )
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version().rpartition('.')[0]}"


def entries(text: str) -> list[Entry]:
    """All measurements of a ledger, oldest first."""
    return [Entry(**json.loads(line)) for line in text.splitlines() if line.strip()]


def last(standing: list[Entry], name: str, kind: str) -> Entry | None:
    """The last measurement of a ratio on a kind of machine."""
    return next((one for one in reversed(standing) if (one.name, one.machine) == (name, kind)), None)


def timed(action: Action, pair: Pair) -> float:
    """What an action took."""
    if pair.takes:
        return float(action())  # type: ignore[arg-type]
    began = pair.clock()
    action()
    return pair.clock() - began


def profile_of(pair: Pair, peer: float) -> dict[str, float]:
    """Own time of the functions that take most, a unit, in units of the peer's time."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(pair.ours)
    times: dict[str, float] = {}
    here = str(Path(__file__).parent.parent)
    for (file, _, function), row in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        place = file.removeprefix(here + "/").rpartition("site-packages/")[2]
        times[f"{place}:{function}"] = times.get(f"{place}:{function}", 0.0) + row[2] / pair.units[0] / peer
    largest = sorted(times.items(), key=lambda item: -item[1])[:KEPT]
    return {name: round(value, 4) for name, value in largest if value > 0}


def measured(one: Ratio) -> Entry:
    """Both sides in turns. Raises `ImportError` if the peer is not installed."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    with tempfile.TemporaryDirectory(dir=RUNS) as folder:
        pair = one.prepare(Path(folder))
        timed(pair.ours, pair), timed(pair.peer, pair)
        turns = [(timed(pair.ours, pair), timed(pair.peer, pair)) for _ in range(one.rounds)]
        ours, peer = (statistics.median(side) / n for side, n in zip(zip(*turns, strict=True), pair.units, strict=True))
        profile = profile_of(pair, peer) if pair.clock is time.process_time and not pair.takes else {}
    commit = git("rev-parse", "--short=8", "HEAD") + ("+" if git("status", "--porcelain", "--", ":!benchmarks") else "")
    date = datetime.now(UTC).date().isoformat()
    return Entry(
        one.name,
        float(f"{ours / peer:.4g}"),
        float(f"{ours:.4g}"),
        float(f"{peer:.4g}"),
        commit,
        date,
        machine(),
        round(load, 1),
        profile,
    )


def grown(before: Entry, now: Entry) -> list[str]:
    """The functions that grew most, in units of the peer's time."""
    growth = {name: value - before.profile.get(name, 0.0) for name, value in now.profile.items()}
    most = sorted(growth.items(), key=lambda item: -item[1])[:NAMED]
    return [
        f"{name}: {before.profile.get(name, 0.0):.3g} to {now.profile[name]:.3g}"
        for name, by in most
        if by > LEAST * now.ratio
    ]


def told(now: Entry, before: Entry | None) -> str:
    """A line for people, with the loss if there is one."""
    text = f"{now.name:20s} {now.ratio:10.4g}"
    if before is None:
        return f"{text}   first on this kind of machine"
    change = now.ratio / before.ratio
    text += f"   {before.ratio:10.4g} at {before.commit} on {before.date}   x {change:.2f}"
    if change <= LOSS:
        return text
    busy = f"; load {now.load} a core now, {before.load} then" if max(now.load, before.load) > 1.0 else ""
    lines = grown(before, now) or ["no profile of both: measure it with cProfile by hand"]
    return "\n".join([f"{text}   LOSS{busy}", *(f"    {line}" for line in lines)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="ratios to measure; all if none is named")
    parser.add_argument("--dry", action="store_true", help="write nothing")
    asked = parser.parse_args()
    strange = [name for name in asked.names if name not in RATIOS]
    if strange:
        parser.error(f"no ratio {', '.join(strange)}; there are {', '.join(RATIOS)}")
    standing = entries(LEDGER.read_text()) if LEDGER.exists() else []
    print(f"{'ratio':20s} {'now':>10s}   {'before':>10s}")
    for name in asked.names or RATIOS:
        try:
            now = measured(RATIOS[name])
        except ImportError as missing:
            print(f"{name:20s} not measured: {missing}; pip install -e '.[bench]'", flush=True)
            continue
        print(told(now, last(standing, name, now.machine)), flush=True)
        if not asked.dry:
            with LEDGER.open("a") as file:
                file.write(json.dumps(asdict(now)) + "\n")


if __name__ == "__main__":
    main()
