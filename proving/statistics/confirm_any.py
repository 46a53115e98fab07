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

from proving.frame import Figures, Results, Study
from proving.ledger import Result
from proving.statistics.dry_runs import dry, plan_from, read
from rig.verbs.confirm import First, consider, following, judge, open_traced, plan_for, propose


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


def confirmed(first: First, folder: Path, hidden: AbstractSet[str], most: int = 3) -> dict[str, object]:
    """What further runs of a traced one say of the `hidden` causes: the best one, then those that a question asks for.

    Args:
        first: the traced run.
        folder: for run files.
        hidden: names of all causes.
        most: number of further runs, at most.
    """
    classes = [[member.effect for member in question.members] for question in first.questions]
    made: list[Path] = []
    proposed: list[Mapping[str, object]] = []
    asked, told = first if first.questions else None, None
    while asked is not None and len(made) < most:
        proposals = propose(consider(asked))
        if not proposals:
            break
        run = proposals[0]
        made.append(dry(plan_for(asked, run.variation, dry=True), folder, asked.world_s + asked.later_s))
        proposed.append({"what": run.variation.what, "size": run.size, "hours": run.hours, "cost_h": run.cost_h})
        told = judge(first, *made)
        asked = following(told)
    answers = () if told is None else told.answers
    held = [[answer.verdict, list(answer.holding), [one.effect for one in answer.minor_causes]] for answer in answers]
    alone = {
        cause.partition(":")[0]
        for answer in answers
        if answer.verdict in ("confirmed", "replaced")
        for cause in answer.members[0].causes
    }
    outcome = "right" if alone == hidden else "wrong" if alone - hidden else "undecided"
    return {"classes": classes, "outcome": outcome, "held": held, "proposed": proposed}


def loops() -> Study:
    """The right one alone after at most three further runs; what was proposed, and how long it takes."""
    return Study({name: partial(loop, cause=cause) for name, cause in CAUSES.items()}, judged)


def judged(results: Results) -> Figures:
    """Outcomes, what was proposed, and what was not right."""
    counts = Counter(one["outcome"] for one in results)
    proposed = [run for one in results for run in one["proposed"]]
    return {
        **{outcome: counts[outcome] for outcome in ("right", "wrong", "undecided")},
        "of": len(results),
        "proposed": dict(Counter(one["what"] for one in proposed)),
        "runs": len(proposed) / len(results),
        "hours": sum(one["hours"] for one in proposed) / len(results),
        "with a person": sum(one["cost_h"] for one in proposed) / len(results),
        "otherwise": {
            f"seed {one['seed']}": [one["classes"], one["held"], [run["size"] for run in one["proposed"]]]
            for one in results
            if one["outcome"] != "right"
        },
    }
