"""Cut the power at random moments of short runs of both procedures, go on, and count what is lost or doubled.

python -m proving.crashes.power_cuts --cuts 1000 [--seed 1] [--lab attitude]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from proving.crashes.runs import PROCEDURES, power_cuts


def main() -> int:
    """As the command line says; 1 if anything is lost, doubled or changed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cuts", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lab", choices=PROCEDURES, action="append")
    asked = parser.parse_args()
    bad = 0
    for lab in asked.lab or PROCEDURES:
        start = time.process_time()
        done = runs = observations = wrong = 0
        seed = asked.seed
        while done < asked.cuts // len(asked.lab or PROCEDURES):
            with tempfile.TemporaryDirectory() as folder:
                cuts, run, verdict = power_cuts(lab, Path(folder), seed, cuts=10)
            done, runs, observations = done + cuts, runs + 1, observations + len(run.acknowledged)
            if verdict:
                wrong += 1
                print(f"{lab}, seed {seed}: {verdict}", flush=True)
            seed += 1
        print(
            f"{lab}: {done} power cuts in {runs} runs, {observations} observations acknowledged, "
            f"{wrong} runs with one lost, doubled or changed ({time.process_time() - start:.0f} s of processor time)",
            flush=True,
        )
        bad += wrong
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
