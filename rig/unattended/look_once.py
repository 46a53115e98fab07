"""One early look at a running run: `python -m rig.unattended.look_once RUN SECONDS`, a process of its own.

It has the lowest priority, takes at most the given seconds of processor time, and is the first that a machine short of
memory kills. It reads the run file and writes nothing but its answer, as JSON on standard output.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Finding, Outcome

NAMELESS = "something without a name"
_SCATTER = ("sigma_E", "sigma_subplot")


def _step_back(most_s: float) -> None:
    """Leave processor and memory to others; the kernel ends this process after so much processor time, seconds."""
    os.nice(19)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write("1000")
    limit = max(1, math.floor(most_s))
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))


def seen(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Findings of a trace: names that the data cannot distinguish, sensors, size over the scatter, and probability."""
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    for one in outcomes:
        for finding in [*(f for f in one.named if f.kind == "effect"), *one.unnamed]:
            names = (finding.effect, *finding.aliases) if finding.effect else (NAMELESS,)
            told = found.setdefault(
                tuple(sorted(names)), {"names": list(names), "sensors": [], "size": None, "p": None, "bound": False}
            )
            told["sensors"].append(one.sensor)
            sizes = [size for size in (told["size"], _size(one, finding)) if size is not None]
            told["size"] = max(sizes) if sizes else None
            if finding.p_adjusted is not None and (told["p"] is None or finding.p_adjusted < told["p"]):
                told["p"], told["bound"] = finding.p_adjusted, finding.p_adjusted_is_bound
    return list(found.values())


def _size(outcome: Outcome, finding: Finding) -> float | None:
    """Size of an effect over the scatter, from the scatter with the declared model and with the effects; None without.

    Its square is the finding's share of what the declared model has beyond scatter.
    """
    before, after = ({row.name: row.value for row in rows} for rows in (outcome.before, outcome.after))
    for name in _SCATTER:
        first, last = before.get(name), after.get(name)
        if isinstance(first, float) and isinstance(last, float) and last > 0.0:
            return math.sqrt(max(first**2 - last**2, 0.0) * max(finding.share, 0.0)) / last
    return None


def main(arguments: Sequence[str]) -> int:
    """Look once; returns the exit code."""
    run, most_s = Path(arguments[0]), float(arguments[1])
    _step_back(most_s)
    from rig.by_kind import trace_table  # noqa: PLC0415 - at the lowest priority, and within the limit
    from rig.tables.table_of_run import run_table  # noqa: PLC0415

    told = seen(trace_table(run_table(run)).outcomes)
    used_s = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    json.dump({"seen": told, "used_s": used_s}, sys.stdout)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
