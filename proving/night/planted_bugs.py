"""After how many nights the campaign finds each bug that is planted in the controller.

python -m proving.night.planted_bugs [most nights]
"""

from __future__ import annotations

import sys

from proving.night.bugs import BUGS
from proving.night.campaign import one_night
from proving.night.scenario import EVERY_LAB


def main() -> int:
    """As the command line says; 1 if a bug was not found."""
    most = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    missed = 0
    for bug in BUGS:
        nights = ((seed, lab, one_night(seed, lab, bug=bug).violations) for seed in range(most) for lab in EVERY_LAB)
        found = next(((seed, lab, broken[0]) for seed, lab, broken in nights if broken), None)
        missed += found is None
        if found is None:
            print(f"{bug:20s} not found in {most} nights of each laboratory", flush=True)
        else:
            seed, lab, first = found
            print(f"{bug:20s} {lab} night {seed + 1}: {first.invariant}: {first.what}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
