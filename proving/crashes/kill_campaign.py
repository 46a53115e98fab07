"""Kill real controllers at random moments until there are enough kills; nothing may be lost, doubled or wrong.

.venv/bin/python -m proving.crashes.kill_campaign --kills 200 [--seed 1] [--lab pressure]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from proving.crashes.kills import PROCEDURES, Tally, one_run

RUNS = Path(__file__).parents[2] / "runs"
"""Not in a memory file system: on the disk that holds the project."""


def main() -> int:
    """As the command line says; 1 if anything is lost, doubled or wrong."""
    RUNS.mkdir(exist_ok=True)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lab", choices=PROCEDURES, default="attitude")
    asked = parser.parse_args()
    total = Tally()
    seed = asked.seed
    while total.kills < asked.kills:
        with tempfile.TemporaryDirectory(dir=RUNS) as folder:
            total.add(one_run(Path(folder), seed, kills=12, longest_s=1.4, lab=asked.lab))
        print(f"seed {seed}: {total}", flush=True)
        seed += 1
    bad = total.lost + total.duplicated + total.wrong_side
    print(
        f"{total.kills} kills in {total.runs} runs of {total.points} points in all: "
        f"{total.lost} lost, {total.duplicated} duplicated, {total.wrong_side} from the wrong side"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
