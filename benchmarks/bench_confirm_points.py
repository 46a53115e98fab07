"""Points of a further run by T-optimality, by HR and BFF, and whole designs: bench hours and right decisions.

The loops of `python -m proving.statistics confirm pairs`: one first run of a world, its trace, then for every way of
choosing the best proposal by the same forecast, that run, and its judgement.

    python -m benchmarks.bench_confirm_points --seeds 3 [--only temperature]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.confirm_peers import BuzziFerrarisForzatti, HunterReiner
from proving.statistics.confirm import NO_ROLL, PAIRS, SMALL
from proving.statistics.dry_runs import dry, one_sensor
from rig.fitter.confirm import Points
from rig.verbs.confirm import consider, judge, open_traced, plan_for, propose

WAYS = {"whole designs": None, "T": Points, "HR": HunterReiner, "BFF": BuzziFerrarisForzatti}


def main() -> None:
    """Print one JSON line per loop, then a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    told: dict[tuple[str, str], list[tuple[float, bool]]] = {}
    for label, (*members, world) in PAIRS.items():
        for hidden, name in members if given.only in label else ():
            for seed in range(given.first, given.first + given.seeds):
                with tempfile.TemporaryDirectory() as folder:
                    run = one_sensor(hidden, world, seed, Path(folder), SMALL if world else NO_ROLL)
                    first = open_traced(run)
                    for way, choice in WAYS.items() if first.questions else ():
                        proposal = propose(consider(first, choice))[0]
                        plan = plan_for(first, proposal.variation, dry=True)
                        later = dry(plan, Path(folder), first.world_s + first.later_s)
                        held = sorted({answer.holding for answer in judge(first, later).answers})
                        right = held == [(name,)]
                        told.setdefault((name, way), []).append((proposal.cost_h, right))
                        line = {"case": f"{label}, truly {name}", "seed": seed, "way": way, "right": right}
                        line |= {"hours": proposal.hours, "cost_h": proposal.cost_h, "size": proposal.size}
                        print(json.dumps(line | {"what": proposal.variation.what, "held": held}), flush=True)
    for way in WAYS:
        loops = [one for (_, of), ones in told.items() if of == way for one in ones]
        if loops:
            hours, right = np.array(loops).T
            cost = f"mean hours with a person {hours.mean():.2f}"
            print(f"{way:15s} {len(loops):3d} loops, right {int(right.sum()):3d}, {cost}")


if __name__ == "__main__":
    main()
