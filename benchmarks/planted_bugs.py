"""After how many nights the campaign finds each bug that is planted in the controller.

python -m benchmarks.planted_bugs [most nights]
"""

from __future__ import annotations

import sys

from rig.simulated.night.bugs import BUGS
from rig.simulated.night.campaign import one_night
from rig.simulated.night.scenario import LABS


def main() -> int:
    most = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    missed = 0
    for bug in BUGS:
        found = {}
        for lab in LABS:
            nights = ((seed, one_night(seed, lab, bug=bug).violations) for seed in range(most))
            found[lab] = next(((seed + 1, broken[0].invariant) for seed, broken in nights if broken), None)
        words = (f"{lab}: night {one[0]} ({one[1]})" if one else f"{lab}: not in {most}" for lab, one in found.items())
        print(f"{bug:20s} {'; '.join(words)}", flush=True)
        missed += not any(found.values())
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
