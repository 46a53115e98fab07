"""What `rig confirm --list` promises beside what `rig confirm` then finds, run after run.

Every world is drawn: which effects are hidden and how large, how many sensors, how noisy they are, which drifts there
are that the forecast knows nothing of. A first run is made dry and traced; of what could be run next, the best and
one drawn at random are made on the same bench in the world's next night, and judged. For each pair of explanations of
which one is true, and for each true effect beside nothing: what came over what was promised.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.statistics.dry_runs import Truth, dry, plan_from, read
from rig.fitter.confirm import NOTHING, Confirmation, Separation
from rig.verbs.confirm import consider, judge, open_traced, plan_for, propose

FLOOR = 0.5
"""Promises below half a standard error are as good as none: a ratio with them says nothing."""
WHOLE_PLOTS = [
    [-90.0, 0.0], [-118.0, -28.0], [-118.0, 28.0], [-62.0, -28.0], [-62.0, 28.0],
    [-90.0, -39.6], [-90.0, 39.6], [-129.6, 0.0], [-50.4, 0.0], [-90.0, 0.0],
]  # fmt: skip
Drawn = tuple[dict[str, Truth], set[str]]
"""Files of a first run, by name, and names of the effects that are hidden."""


def _head(axis: str, arcsec: float, periods: float, phase: float) -> Truth:
    return {"axis": axis, "amplitude_arcsec": arcsec, "periods_per_turn": periods, "phase_deg": phase}


def _attitude_effects(rng: np.random.Generator) -> tuple[dict[str, Truth], Truth]:
    """What is hidden, by the name of its effect, and the rest of the world."""
    size = float(np.exp(rng.uniform(np.log(0.4), np.log(2.0))))
    cold = {"lab": {"drift_degC_per_day": -2.0, "daily_amplitude_degC": 0.1}, "enclosure": {"leak": 0.5}}
    kinds: list[tuple[dict[str, Truth], Truth]] = [
        ({"isolation-pad-deflection": {"isolation_pad": {"pitch_compliance_deg_per_g": 6e-4 * size}}}, {}),
        ({"head-once-per-turn": {"head_error": [_head("pitch", 1.5 * size, 1.0, 0.0)]}}, {}),
        ({"head-twice-per-turn": {"head_error": [_head("pitch", 2.0 * size, 2.0, 0.0)]}}, {}),
        ({"sensor-third-order": {"third_order": {"ug_per_g3": 20.0 * size}}}, {}),
        ({"sensor-second-order": {"second_order": {"ug_per_g2": 8.0 * size}}}, {}),
        ({"offset-temperature": {"offset_temperature": {"uV_per_degC": 200.0 * size}}}, cold),
        ({"offset-drift": {"offset_drift": {"uV_per_h": 8.0 * size}}}, cold),
    ]  # fmt: skip
    hidden, world = kinds[int(rng.integers(len(kinds)))]
    if rng.random() < 0.3 and "offset" not in next(iter(hidden)):
        hidden = kinds[0][0] | kinds[3][0]
    return hidden, world


def _attitude(rng: np.random.Generator) -> Drawn:
    """Files of a first run and the names of what is hidden."""
    bench, procedure = read("attitude-lab", "bench", "night")
    sensors = sorted(bench["sensors"])[: int(rng.choice([1, 1, 3]))]
    bench["sensors"] = {name: bench["sensors"][name] for name in sensors}
    procedure["replications"] = int(rng.choice([3, 4, 6]))
    hidden, world = _attitude_effects(rng)
    small = {"type": "D1", "pitch_max_deg": 180, "pitch_count": 13, "roll_count": 13}
    pitches = np.linspace(-180, 180, int(rng.choice([19, 25, 37]))).tolist()
    rolled = bool(world) or len(sensors) == 3
    procedure["design"] = small if rolled else {"type": "D", "pitch_deg": pitches, "roll_deg": [0.0]}
    procedure["environment"]["tolerance_degC"] = 5.0
    effects = {k: v for truth in hidden.values() for k, v in truth.items()}
    if "offset_drift" not in effects and rng.random() < 0.5:
        effects["offset_drift"] = {"uV_per_h": float(rng.normal(0.0, 0.2))}
    noise = {name: {"noise_V": 17e-6 * float(np.exp(rng.normal(0.0, 0.3)))} for name in sensors}
    truth = {"seed": int(rng.integers(1, 10**6)), "effects": effects, "sensors": noise, **world}
    return {"bench.toml": bench, "procedure.toml": procedure, "world.toml": truth}, set(hidden)


def _pressure(rng: np.random.Generator) -> Drawn:
    """The same of pressure transducers."""
    bench, procedure = read("pressure-lab", "bench", "procedure")
    sensors = sorted(bench["sensors"])[: int(rng.choice([1, 2]))]
    bench["sensors"] = {name: bench["sensors"][name] for name in sensors}
    procedure["design"] = {
        "type": "list", "temperatures_degC": WHOLE_PLOTS, "pressures_psia": [0.12, 0.5, 1.0, 2.5, 4.0, 5.0],
        "repeated_psia": [0.12, 5.0] if rng.random() < 0.5 else [],
    }  # fmt: skip
    procedure["soak"] |= {"dwell_s": 300, "drift_degC_per_h": 5.0}
    size = float(np.exp(rng.uniform(np.log(0.5), np.log(2.5))))
    kinds: list[dict[str, Truth]] = [
        {"pressure-third-order": {"third_order_pressure": {"uV_per_psi3": 1.5 * size}}},
        {"hysteresis": {"hysteresis": {"uV": 6.0 * size}}},
        {"carry-over": {"carry_over": {"pct": 0.5 * size, "time_constant_s": 120}}},
        {"pressure-squared-temperature": {"pressure_squared_temperature": {"sensor_nV_per_psi2_degC": 10 * size}}},
        {"sensor-temperature-third-order": {"third_order_temperature": {"sensor_nV_per_degC3": 1.0 * size}}},
    ]  # fmt: skip
    hidden = kinds[int(rng.integers(len(kinds)))]
    if rng.random() < 0.3:
        hidden = kinds[0] | kinds[1]
    effects = {k: v for truth in hidden.values() for k, v in truth.items()}
    if rng.random() < 0.5:
        effects["wholeplot_drift"] = {"uV_per_h": float(rng.normal(0.0, 0.05))}
    spread = {
        "wholeplot_mV": 0.0155 * float(np.exp(rng.normal(0.0, 0.4))),
        "subplot_mV": 0.0045 * float(np.exp(rng.normal(0.0, 0.3))),
    }
    truth = {"seed": int(rng.integers(1, 10**6)), "effects": effects, "sensors": dict.fromkeys(sensors, spread)}
    return {"bench.toml": bench, "procedure.toml": procedure, "world.toml": truth}, set(hidden)


LABS: Mapping[str, Callable[[np.random.Generator], Drawn]] = {"attitude": _attitude, "pressure": _pressure}


def forecasts(stream: int = 1, runs: int = 100) -> Study:
    """Worlds of a stream, until so many further runs of each laboratory were made and judged."""
    cases = {lab: partial(_world, lab=lab, stream=stream) for lab in LABS}
    return Study(cases, _counted, _compared, lambda known: _made(known) >= runs)


def _world(number: int, lab: str, stream: int) -> Result:
    """What became of the promises of each further run in one world."""
    rng = np.random.default_rng([stream, number, lab == "pressure"])
    files, hidden = LABS[lab](rng)
    made = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = open_traced(dry(plan_from(files), folder))
        proposals = propose(consider(first)) if first.questions else []
        chosen = list(range(min(1, len(proposals))))
        if len(proposals) > 1:
            chosen.append(int(rng.choice(np.arange(1, len(proposals)), 1, replace=False)[0]))
        for take in chosen:
            proposal = proposals[take]
            later = dry(plan_for(first, proposal.variation, dry=True), folder, first.world_s + first.later_s)
            answers = judge(first, later).answers
            told = [
                one
                for promise, answer in zip(proposal.separations, answers, strict=True)
                for one in _promises(hidden, promise, answer)
            ]
            made.append({"what": proposal.variation.what, "told": told})
    return {"runs": made}


def _promises(hidden: set[str], promise: Separation, answer: Confirmation) -> Iterator[dict[str, Any]]:
    """What was promised and what came, for each pair that a true effect is one of."""
    members = {m.effect: m for m in answer.members}
    for pair, promised in promise.sigmas.items():
        true = next((name for name in pair if name in hidden), None)
        if true is None:
            continue
        if pair[1] == NOTHING:
            came, excluded = members[true].shown, members[true].shown >= members[true].limit
        else:
            (false,) = (name for name in pair if name != true)
            came = abs(members[false].sigmas ** 2 - members[true].sigmas ** 2) ** 0.5
            excluded = members[false].sigmas > members[false].limit >= members[true].sigmas
        low, high = promise.intervals[pair]
        yield {
            "pair": list(pair),
            "promised": float(promised),
            "inside": bool(low <= came <= high),
            "chance": float(promise.chances[pair]),
            "came": float(came),
            "separated": bool(excluded),
        }


def _made(results: Results) -> int:
    """Further runs that say something of a true effect."""
    return sum(bool(run["told"]) for one in results for run in one["runs"])


def _counted(results: Results) -> Figures:
    return {"further runs": _made(results), "in worlds": sum(_made([one]) > 0 for one in results)}


def _compared(found: Mapping[str, Results]) -> Mapping[str, Figures]:
    promises = {
        lab: [t for one in results for run in one["runs"] for t in run["told"]] for lab, results in found.items()
    }
    rows = {}
    for lab, every in promises.items():
        rows[f"{lab}, one explanation from another"] = _came([one for one in every if one["pair"][1] != NOTHING])
        rows[f"{lab}, from nothing"] = _came([one for one in every if one["pair"][1] == NOTHING])
    return {**rows, "all": _came([one for every in promises.values() for one in every])}


def _came(promises: list[dict[str, Any]]) -> Figures:
    """What came over what was promised, in quantiles; and shares in percent."""
    worth = [one["came"] / one["promised"] for one in promises if one["promised"] >= FLOOR]
    counts = {"promises": len(promises), "worth counting": len(worth)}
    if not worth:
        return counts
    q = np.quantile(worth, [0.05, 0.25, 0.5, 0.75, 0.95]).tolist()
    inside, separated, chance = (
        100.0 * float(np.mean([one[name] for one in promises])) for name in ("inside", "separated", "chance")
    )
    return {
        **counts,
        "median": q[2],
        "half within": [q[1], q[3]],
        "90 % within": [q[0], q[4]],
        "in the 90 % interval": inside,
        "separated": separated,
        "promised": chance,
    }


PARTS = {"": Part(forecasts, 200, 1)}
