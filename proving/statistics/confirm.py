"""Look-alikes through the whole bench: traced, a further run proposed, made and judged.

Four pairs that one run cannot tell apart, each member hidden in turn: a dry run of the attitude bench, its trace, the
cheapest further run that should part them, that run on the same simulated bench (turned if the proposal says so, in
the world's next night), and the judgement. The same with two causes hidden, in one class and in two. And one that
needs no further run: 37 x 13 points over the whole turn.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.statistics.confirm_any import confirmed, judged, loops
from proving.statistics.dry_runs import Truth, one_sensor
from rig.verbs.confirm import open_traced

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
TWO: dict[str, tuple[Hidden, Hidden, Truth]] = {
    "pads and an eccentric head": (*PAIRS["pads or an eccentric head"][:2], {}),
    "cube and head twice a turn": (*PAIRS["cube or head twice a turn"][:2], {}),
    "pads and cube": ((PADS, "isolation-pad-deflection"), (CUBE, "sensor-third-order"), {}),
    "square and temperature": ((SQUARE, "sensor-second-order"), (WARM, "offset-temperature"), NIGHT),
    "head twice a turn and drift": ((TWICE, "head-twice-per-turn"), (DRIFT, "offset-drift"), NIGHT),
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
            cases[f"{label}, truly {name}"] = partial(_loop, hidden=hidden, names=frozenset({name}), world=world)
    return Study(cases, judged)


def two() -> Study:
    """Two causes at once. Right: each has a question that ends with it alone. Wrong: another cause ends alone."""
    cases = {}
    for label, (*members, world) in TWO.items():
        effects: Truth = {}
        for hidden, _ in members:
            effects |= hidden
        names = frozenset(name for _, name in members)
        cases[label] = partial(_loop, hidden=effects, names=names, world=world)
    return Study(cases, judged)


def _loop(seed: int, hidden: Truth, names: frozenset[str], world: Truth) -> Result:
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        first = open_traced(one_sensor(hidden, world, seed, folder, SMALL if world else NO_ROLL))
        return {"seed": seed, **confirmed(first, folder, names)}


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


PARTS = {
    "pairs": Part(pairs, 20, 1),
    "two": Part(two, 8, 1),
    "already": Part(already, 20, 1),
    "laboratories": Part(loops, 5, 1),
}
