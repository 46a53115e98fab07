"""Give every door of the program mutated inputs; none may end in a traceback, hang for 5 s or take a gigabyte.

.venv/bin/python -m benchmarks.fuzz --inputs 1000 [--door run] [--seed 1]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from doors import DOORS, Found, Material, attack


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=1000, help="for each door")
    parser.add_argument("--seed", type=int, default=1, help="of the first input; the others count on from it")
    parser.add_argument("--door", choices=sorted(DOORS), action="append", help="only this one; repeatable")
    asked = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        material = Material.make(Path(folder))
        for door in asked.door or DOORS:
            found = Found()
            for seed in range(asked.seed, asked.seed + asked.inputs):
                attack(door, seed, material, found)
            print(
                f"{door}: seeds {asked.seed} to {asked.seed + asked.inputs - 1}, {found.inputs} inputs, "
                f"{found.tracebacks} tracebacks, {found.hangs} hangs, {found.memory} beyond 1 GB",
                flush=True,
            )
            for what, example in found.examples.items():
                print(f"  {what}: {example}")
            wrong += found.wrong
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
