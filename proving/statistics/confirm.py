"""Look-alikes through the whole bench: traced, a further run proposed, made and judged.

Four pairs that one run cannot tell apart, each member hidden in turn: a dry run of the attitude bench, its trace, the
cheapest further run that should part them, that run on the same simulated bench (turned if the proposal says so, in
the world's next night), and the judgement. And one that needs no further run: 37 x 13 points over the whole turn.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

from proving.ledger import Result
from proving.statistics.confirm_any import loops
from proving.statistics.dry_runs import Truth, dry, one_sensor
from proving.statistics.frame import Figures, Part, Results, Study
from rig.closed_loop.confirm import consider, judge, open_traced, plan_for, propose

PADS: Truth = {"isolation_pad": {"pitch_compliance_deg_per_g": 5e-4}}
ONCE: Truth = {"head_error": [{"axis": "pitch", "amplitude_arcsec": 1.0, "periods_per_turn": 1.0, "phase_deg": 0.0}]}
ONCE_COSINE: Truth = {
    "head_error": [{"axis": "pitch", "amplitude_arcsec": 1.5, "periods_per_turn": 1.0, "phase_deg": 90.0}]
}
TWICE: Truth = {"head_error": [{"axis": "pitch", "amplitude_arcsec": 2.0, "periods_per_turn": 2.0, "phase_deg": 0.0}]}
SQUARE: Truth = {"second_order": {"ug_per_g2": 8.0}}
CUBE: Truth = {"third_order": {"ug_per_g3": 20.0}}
WARM: Truth = {"offset_temperature": {"uV_per_degC": 200.0}}
DRIFT: Truth = {"offset_drift": {"uV_per_h": 8.0}}
NIGHT: Truth = {"lab": {"drift_degC_per_day": -2.0, "daily_amplitude_degC": 0.1}, "enclosure": {"leak": 0.5}}
"""A cold spell: through the night the temperature falls evenly, and what it does looks like a drift."""

NO_ROLL: Truth = {"type": "D", "pitch_deg": [-180.0 + 10.0 * i for i in range(37)], "roll_deg": [0.0]}
SMALL: Truth = {"type": "D1", "pitch_max_deg": 180, "pitch_count": 13, "roll_count": 13}
WHOLE: Truth = {"type": "D1", "pitch_max_deg": 180, "pitch_count": 37, "roll_count": 13}

Hidden = tuple[Truth, str]
PAIRS: dict[str, tuple[Hidden, Hidden, Truth]] = {
    "pads or an eccentric head": ((PADS, "isolation-pad-deflection"), (ONCE, "head-once-per-turn"), {}),
    "cube or head twice a turn": ((CUBE, "sensor-third-order"), (TWICE, "head-twice-per-turn"), {}),
    "square or head once a turn": ((SQUARE, "sensor-second-order"), (ONCE_COSINE, "head-once-per-turn"), {}),
    "temperature or drift": ((WARM, "offset-temperature"), (DRIFT, "offset-drift"), NIGHT),
}
ALREADY = (
    (PADS, "isolation-pad-deflection", "head-once-per-turn"),
    (ONCE, "head-once-per-turn", "isolation-pad-deflection"),
)


def pairs() -> Study:
    """The right one alone after the further run; what was proposed, and how long it takes."""
    cases = {}
    for label, (*members, world) in PAIRS.items():
        for hidden, name in members:
            cases[f"{label}, truly {name}"] = partial(_loop, hidden=hidden, name=name, world=world)
    return Study(cases, _parted)


def _loop(seed: int, hidden: Truth, name: str, world: Truth) -> Result:
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        first = open_traced(one_sensor(hidden, world, seed, folder, SMALL if world else NO_ROLL))
        classes = [sorted({member.effect for member in question.members}) for question in first.questions]
        result = {"seed": seed, "classes": classes, "with others": any(len(c) > 1 and name in c for c in classes)}
        if not first.questions:
            return {**result, "right": False, "held": [], "proposed": None}
        proposal = propose(consider(first))[0]
        later = dry(plan_for(first, proposal.variation, dry=True), folder, first.world_s + first.later_s)
        held = sorted({answer.holding for answer in judge(first, later).answers})
    proposed = {"what": proposal.variation.what, "hours": proposal.hours}
    return {**result, "right": held == [(name,)], "held": held, "proposed": proposed}


def _parted(results: Results) -> Figures:
    proposed = [one["proposed"] for one in results if one["proposed"] is not None]
    return {
        "right alone": sum(one["right"] for one in results),
        "with others before": sum(one["with others"] for one in results),
        "of": len(results),
        "proposed": dict(Counter(one["what"] for one in proposed)),
        "hours": sum(one["hours"] for one in proposed) / max(len(proposed), 1),
        "otherwise": {f"seed {one['seed']}": [one["classes"], one["held"]] for one in results if not one["right"]},
    }


def already() -> Study:
    """Where shared attitudes tell already: 37 x 13 over +-180 deg, one sensor."""
    cases = {
        f"truly {name}": partial(_already, hidden=hidden, name=name, alias=alias) for hidden, name, alias in ALREADY
    }
    return Study(cases, _excluded)


def _already(seed: int, hidden: Truth, name: str, alias: str) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        first = open_traced(one_sensor(hidden, {}, seed, Path(folder), WHOLE))
    members = [{member.effect for member in question.members} for question in first.questions]
    return {"excluded": any(name in m for m in members) and not any(alias in m for m in members)}


def _excluded(results: Results) -> Figures:
    return {"the other excluded without a further run": sum(one["excluded"] for one in results), "of": len(results)}


PARTS = {"pairs": Part(pairs, 20, 1), "already": Part(already, 20, 1), "laboratories": Part(loops, 5, 1)}
