"""What `rig confirm --list` promises beside what `rig confirm` then finds, run after run.

    python -m benchmarks.confirm_forecast [--runs 200] [--seed 1] [--kind attitude|pressure]

Every world is drawn: which effects are hidden and how large, how many sensors, how noisy they are, which drifts there
are that the forecast knows nothing of. A first run is made dry and traced; of what could be run next, the best and
one drawn at random are made on the same bench in the world's next night, and judged. For each pair of explanations of
which one is true, and for each true effect beside nothing: what came over what was promised.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fitter.confirm import NOTHING, Confirmation, Separation
from rig.closed_loop.confirm import consider, judge, open_traced, plan_for, propose
from rig.config import parse_toml
from rig.controller import start_run
from rig.engine.session import Signals
from rig.examples import example
from rig.plans import Plan, plan_of
from rig.toml_text import toml_text

RUNS_A_WORLD = 2
FLOOR = 0.5
"""Promises below half a standard error are as good as none: a ratio with them says nothing."""
WHOLE_PLOTS = [
    [-90.0, 0.0], [-118.0, -28.0], [-118.0, 28.0], [-62.0, -28.0], [-62.0, 28.0],
    [-90.0, -39.6], [-90.0, 39.6], [-129.6, 0.0], [-50.4, 0.0], [-90.0, 0.0],
]  # fmt: skip
Truth = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """One promise and what became of it."""

    kind: str
    world: int
    run: str
    pair: tuple[str, str]
    promised: float
    low: float
    high: float
    chance: float
    came: float
    excluded: bool

    @property
    def ratio(self) -> float:
        return self.came / self.promised


def head(axis: str, arcsec: float, periods: float, phase: float) -> Truth:
    return {"axis": axis, "amplitude_arcsec": arcsec, "periods_per_turn": periods, "phase_deg": phase}


def attitude_effects(rng: np.random.Generator) -> tuple[dict[str, Truth], Truth]:
    """What is hidden, by the name of its effect, and the rest of the world."""
    size = float(np.exp(rng.uniform(np.log(0.4), np.log(2.0))))
    cold = {"lab": {"drift_degC_per_day": -2.0, "daily_amplitude_degC": 0.1}, "enclosure": {"leak": 0.5}}
    kinds: list[tuple[dict[str, Truth], Truth]] = [
        ({"isolation-pad-deflection": {"isolation_pad": {"pitch_compliance_deg_per_g": 6e-4 * size}}}, {}),
        ({"head-once-per-turn": {"head_error": [head("pitch", 1.5 * size, 1.0, 0.0)]}}, {}),
        ({"head-twice-per-turn": {"head_error": [head("pitch", 2.0 * size, 2.0, 0.0)]}}, {}),
        ({"sensor-third-order": {"third_order": {"ug_per_g3": 20.0 * size}}}, {}),
        ({"sensor-second-order": {"second_order": {"ug_per_g2": 8.0 * size}}}, {}),
        ({"offset-temperature": {"offset_temperature": {"uV_per_degC": 200.0 * size}}}, cold),
        ({"offset-drift": {"offset_drift": {"uV_per_h": 8.0 * size}}}, cold),
    ]  # fmt: skip
    hidden, world = kinds[int(rng.integers(len(kinds)))]
    if rng.random() < 0.3 and "offset" not in next(iter(hidden)):
        hidden = kinds[0][0] | kinds[3][0]
    return hidden, world


def attitude(rng: np.random.Generator) -> tuple[dict[str, Truth], set[str]]:
    """Files of a first run and the names of what is hidden."""
    lab = example("attitude-lab")
    bench, procedure = (parse_toml((lab / f"{n}.toml").read_text(), n) for n in ("bench", "night"))
    sensors = sorted(bench["sensors"])[: int(rng.choice([1, 1, 3]))]
    bench["sensors"] = {name: bench["sensors"][name] for name in sensors}
    procedure["replications"] = int(rng.choice([3, 4, 6]))
    hidden, world = attitude_effects(rng)
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


def pressure(rng: np.random.Generator) -> tuple[dict[str, Truth], set[str]]:
    """The same of pressure transducers."""
    lab = example("pressure-lab")
    bench, procedure = (parse_toml((lab / f"{n}.toml").read_text(), n) for n in ("bench", "procedure"))
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


def dry(plan: Plan, folder: Path, start_s: float = 0.0) -> Path:
    paths: list[Path] = []
    start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None, world_start_s=start_s)
    return paths[0]


def one_world(kind: str, number: int, seed: int, laters: int = RUNS_A_WORLD) -> Iterator[tuple[str, list[Outcome]]]:
    """Each further run, with what became of its promises."""
    rng = np.random.default_rng([seed, number, kind == "pressure"])
    files, hidden = (pressure if kind == "pressure" else attitude)(rng)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = dry(plan_of({n: toml_text(v) for n, v in files.items()}, dry=True), folder)
        first = open_traced(path)
        if not first.questions:
            return
        proposals = propose(consider(first))
        chosen = list(range(min(1, len(proposals))))
        if len(proposals) > 1:
            chosen += rng.choice(np.arange(1, len(proposals)), min(laters, len(proposals)) - 1, replace=False).tolist()
        for take in chosen:
            proposal = proposals[take]
            later = dry(plan_for(first, proposal.variation, dry=True), folder, first.world_s + first.later_s)
            found = judge(first, later).answers
            told = [
                outcome
                for promise, answer in zip(proposal.separations, found, strict=True)
                for outcome in compare(kind, number, proposal.variation.what, hidden, promise, answer)
            ]
            yield proposal.variation.what, told


def compare(
    kind: str, number: int, what: str, hidden: set[str], promise: Separation, answer: Confirmation
) -> Iterator[Outcome]:
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
        yield Outcome(kind, number, what, pair, promised, low, high, promise.chances[pair], came, excluded)


def campaign(runs: int, seed: int, kinds: tuple[str, ...], *, verbose: bool = False) -> list[Outcome]:
    out: list[Outcome] = []
    for kind in kinds:
        made, number = 0, 0
        while made < runs // len(kinds):
            number += 1
            for what, told in one_world(kind, number, seed):
                made += bool(told)
                out += told
                if verbose:
                    for o in told:
                        print(f"  {kind} {number} {what}: {o.pair} {o.promised:.1f} ({o.low:.1f} to {o.high:.1f}), "
                              f"{o.chance:.2f}: {o.came:.1f}", flush=True)  # fmt: skip
    return out


def said(name: str, outcomes: list[Outcome]) -> str:
    worth = [o for o in outcomes if o.promised >= FLOOR]
    if not worth:
        return f"{name}: none"
    ratios = np.array([o.ratio for o in worth])
    q = np.quantile(ratios, [0.05, 0.25, 0.5, 0.75, 0.95])
    inside = np.mean([o.low <= o.came <= o.high for o in outcomes])
    chance, excluded = (np.mean([getattr(o, what) for o in outcomes]) for what in ("chance", "excluded"))
    return (
        f"{name}: {len(worth)} of {len(outcomes)} promises; came over promised: median {q[2]:.2f}, "
        f"half within {q[1]:.2f} to {q[3]:.2f}, 90 % within {q[0]:.2f} to {q[4]:.2f}; "
        f"in the 90 % interval {inside:.0%}; separated {excluded:.0%}, promised {chance:.0%}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=["attitude", "pressure"])
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    kinds = (given.kind,) if given.kind else ("attitude", "pressure")
    begun = time.perf_counter()
    out = campaign(given.runs, given.seed, kinds, verbose=given.verbose)
    for kind in kinds:
        mine = [o for o in out if o.kind == kind]
        print(said(f"{kind}, one explanation from another", [o for o in mine if o.pair[1] != NOTHING]))
        print(said(f"{kind}, from nothing", [o for o in mine if o.pair[1] == NOTHING]))
    print(said("all", out))
    firsts = {}
    for o in out:
        firsts.setdefault((o.kind, o.world, o.run), o)
    worlds = len({(o.kind, o.world) for o in out})
    print(f"{len(firsts)} further runs in {worlds} worlds, {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
