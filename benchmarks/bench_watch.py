"""The live page of a long run: processor time and size of the first look, of the next one, and of an idle one.

.venv/bin/python -m benchmarks.bench_watch 100000
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from pathlib import Path

from rig.procedures.plan.run_list import Factor, Point, RunList
from rig.run_file.chain import Record, encode
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.watch.feed import RunFeed, encoded


def main() -> None:
    many = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.sqlite"
        factors = (Factor("pitch_deg", "pitch"), Factor("roll_deg", "roll"))
        points = tuple(Point(i, 1, None, (float(i % 37), float(i % 25)), (1, 1)) for i in range(many))
        about = {"procedure": "long", "bench": "bench", "software": {}}
        run_list = RunList(factors, points, 0)
        create(path, Genesis("long", {"procedure.toml": ""}, run_list, True, about), elapsed_s=0.0, utc_s=1e9)
        channel = {"mean": 0.1, "sd": 1e-5, "readings": [0.1 + 1e-6 * i for i in range(10)]}
        settling = {"pitch": {"samples": [[i / 2, 1.0] for i in range(40)]}}
        body = encode({"outputs": dict.fromkeys(("x_V", "y_V", "z_V"), channel), "settling": settling, "flags": []})
        with RunWriter.open(path) as run:
            for i in range(many - 1):
                observed = Record(1, "observation", 10.0 * i, 1e9 + 10.0 * i, i, None, 1, "accepted", body)
                run.append(observed, commit=i % 1000 == 999 or i == many - 2)
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            feed = RunFeed(path, None, iter(range(0, 10**6, 10)).__next__, time.time)
            first = _spent(feed.refresh)
            run.append(Record(1, "observation", 1e6, 2e9, many - 1, None, 1, "accepted", body))
            following = _spent(feed.refresh)
            idle = _spent(feed.refresh)
            size = len(encoded(feed.view()))
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before
        done = json.loads(encoded(feed.view()))["state"]["done"]
        print(f"{done} of {many} points, run file {path.stat().st_size / 1e6:.0f} MB")
        print(f"first look {first:.2f} s, one more record {following * 1e3:.0f} ms, nothing new {idle * 1e3:.1f} ms")
        print(f"all that the page is sent: {size / 1e3:.0f} kB; memory grown by {grown:.0f} MB")


def _spent(work: object) -> float:
    began = time.process_time()
    work()  # type: ignore[operator]
    return time.process_time() - began


if __name__ == "__main__":
    main()
