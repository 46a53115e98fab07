"""Hidden causes in the example laboratories of the general kind, through the whole bench: traced, confirmed, judged.

Three causes for each laboratory, each hidden in turn: a dry run, its trace, the best further run, that run on the same
simulated bench on the next day, and the judgement. Right: one explanation of the hidden cause holds, and it is that
cause. Wrong: another one alone. Everything else is undecided.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from proving.ledger import Result
from proving.statistics.dry_runs import dry, plan_from, read
from proving.statistics.frame import Figures, Results, Study
from rig.closed_loop.confirm import First, consider, judge, open_traced, plan_for, propose


@dataclass(frozen=True)
class Cause:
    """What a laboratory's declared model lacks.

    Attributes:
        lab: folder of the example.
        named: its name, without the columns.
        hidden: formula by sensor; the example's own for None.
    """

    lab: str
    named: str
    hidden: Mapping[str, str] | None = None

    def first(self, seed: int, folder: Path) -> Path:
        """A dry run with it."""
        bench, procedure, world = read(self.lab, "bench", "procedure", "world")
        procedure["seed"] = world["seed"] = seed
        if self.hidden is not None:
            for name, sensor in world["sensors"].items():
                sensor["hidden"] = self.hidden.get(name, "")
        return dry(plan_from({"bench.toml": bench, "procedure.toml": procedure, "world.toml": world}), folder)


_LOOP = "0.0005*force_side*(1 - ((force_kN - 5)/5)^2)"
CAUSES: Mapping[str, Cause] = {
    "load cell: creep": Cause("load-cell-lab", "creep"),
    "load cell: hysteresis": Cause("load-cell-lab", "hysteresis", {"cell": _LOOP}),
    "load cell: cube": Cause("load-cell-lab", "third-order", {"cell": "0.00001*(force_kN - 5)^3"}),
    "bath: self-heating": Cause("bath-lab", "self-heating"),
    "bath: fourth order": Cause("bath-lab", "fourth-order", {"couple": "2e-9*(bath_degC - 50)^4"}),
    "bath: drift": Cause("bath-lab", "drift", {"couple": "0.002*elapsed_h"}),
    "voltmeter: range step": Cause("voltmeter-lab", "range-step"),
    "voltmeter: range gain": Cause(
        "voltmeter-lab", "range-gain", {"meter": "5e-6*input_V*min(max(1e6*(abs(input_V) - 12), 0), 1)"}
    ),
    "voltmeter: cube": Cause("voltmeter-lab", "third-order", {"meter": "4e-13*input_V^3"}),
}


def loop(seed: int, cause: Cause) -> Result:
    """What comes of one."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        return {"seed": seed, **confirmed(open_traced(cause.first(seed, folder)), folder, {cause.named})}


def confirmed(first: First, folder: Path, hidden: AbstractSet[str]) -> dict[str, object]:
    """What the best further run of a traced one says of the `hidden` causes."""
    classes = [[member.effect for member in question.members] for question in first.questions]
    proposals = propose(consider(first)) if first.questions else ()
    if not proposals:
        return {"classes": classes, "outcome": "undecided", "held": [], "proposed": None}
    proposal = proposals[0]
    later = dry(plan_for(first, proposal.variation, dry=True), folder, first.world_s + first.later_s)
    answers = judge(first, later).answers
    held = [[answer.verdict, list(answer.holding)] for answer in answers]
    alone = {answer.holding[0].partition(":")[0] for answer in answers if answer.verdict in ("confirmed", "replaced")}
    outcome = "right" if alone == hidden else "wrong" if alone - hidden else "undecided"
    proposed = {"what": proposal.variation.what, "size": proposal.size, "hours": proposal.hours}
    return {"classes": classes, "outcome": outcome, "held": held, "proposed": proposed}


def loops() -> Study:
    """The right one alone after the further run; what was proposed, and how long it takes."""
    return Study({name: partial(loop, cause=cause) for name, cause in CAUSES.items()}, judged)


def judged(results: Results) -> Figures:
    """Outcomes, what was proposed, and what was not right."""
    counts = Counter(one["outcome"] for one in results)
    proposed = [one["proposed"] for one in results if one["proposed"] is not None]
    return {
        **{outcome: counts[outcome] for outcome in ("right", "wrong", "undecided")},
        "of": len(results),
        "proposed": dict(Counter(one["what"] for one in proposed)),
        "hours": sum(one["hours"] for one in proposed) / max(len(proposed), 1),
        "otherwise": {
            f"seed {one['seed']}": [one["classes"], one["held"]] for one in results if one["outcome"] != "right"
        },
    }
