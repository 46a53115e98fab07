"""Look-alikes through the whole bench: traced, a further run proposed, made and judged, seed after seed.

    python -m benchmarks.confirm_campaign [seeds] [pair]

Four pairs that one run cannot tell apart, each member hidden in turn: a dry run of the attitude bench, its trace, the
cheapest further run that should part them, that run on the same simulated bench (turned if the proposal says so, in
the world's next night), and the judgement. And one that needs no further run: 37 x 13 points over the whole turn.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
import time
from pathlib import Path

from rig.closed_loop.confirm import consider, judge, open_traced, plan_for, propose
from rig.config import parse_toml
from rig.controller import start_run
from rig.engine.session import Signals
from rig.examples import example
from rig.plans import plan_of
from rig.toml_text import toml_text

LAB = example("attitude-lab")
PADS = {"isolation_pad": {"pitch_compliance_deg_per_g": 5e-4}}
ONCE = {"head_error": [{"axis": "pitch", "amplitude_arcsec": 1.0, "periods_per_turn": 1.0, "phase_deg": 0.0}]}
ONCE_COSINE = {"head_error": [{"axis": "pitch", "amplitude_arcsec": 1.5, "periods_per_turn": 1.0, "phase_deg": 90.0}]}
TWICE = {"head_error": [{"axis": "pitch", "amplitude_arcsec": 2.0, "periods_per_turn": 2.0, "phase_deg": 0.0}]}
SQUARE = {"second_order": {"ug_per_g2": 8.0}}
CUBE = {"third_order": {"ug_per_g3": 20.0}}
WARM = {"offset_temperature": {"uV_per_degC": 200.0}}
DRIFT = {"offset_drift": {"uV_per_h": 8.0}}
NIGHT = {"lab": {"drift_degC_per_day": -2.0, "daily_amplitude_degC": 0.1}, "enclosure": {"leak": 0.5}}
"""A cold spell: through the night the temperature falls evenly, and what it does looks like a drift."""

NO_ROLL = {"type": "D", "pitch_deg": [-180.0 + 10.0 * i for i in range(37)], "roll_deg": [0.0]}
SMALL = {"type": "D1", "pitch_max_deg": 180, "pitch_count": 13, "roll_count": 13}
WHOLE = {"type": "D1", "pitch_max_deg": 180, "pitch_count": 37, "roll_count": 13}

PAIRS = {
    "pads or an eccentric head": ((PADS, "isolation-pad-deflection"), (ONCE, "head-once-per-turn"), {}),
    "cube or head twice a turn": ((CUBE, "sensor-third-order"), (TWICE, "head-twice-per-turn"), {}),
    "square or head once a turn": ((SQUARE, "sensor-second-order"), (ONCE_COSINE, "head-once-per-turn"), {}),
    "temperature or drift": ((WARM, "offset-temperature"), (DRIFT, "offset-drift"), NIGHT),
}


def dry(plan, folder, start=0.0):
    paths = []
    start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None, world_start_s=start)
    return paths[0]


def first_run(effects, world, seed, folder, design):
    """One x sensor, six replications of a design."""
    bench = parse_toml((LAB / "bench.toml").read_text(), "bench")
    bench["sensors"] = {"x": bench["sensors"]["x"]}
    procedure = parse_toml((LAB / "night.toml").read_text(), "procedure")
    procedure["design"] = design
    procedure["environment"]["tolerance_degC"] = 5.0
    truth = {"seed": seed, "effects": effects, **world}
    documents = {"bench.toml": bench, "procedure.toml": procedure, "world.toml": truth}
    return dry(plan_of({name: toml_text(values) for name, values in documents.items()}, dry=True), folder)


def loop(hidden, world, seed):
    """(named with its alias, proposal, verdict) of one whole loop."""
    with tempfile.TemporaryDirectory() as folder:
        first = open_traced(first_run(hidden, world, seed, Path(folder), SMALL if world else NO_ROLL))
        classes = [{m.effect for m in q.members} for q in first.questions]
        if not first.questions:
            return classes, None, "nothing found", ()
        proposal = propose(consider(first))[0]
        plan = plan_for(first, proposal.variation, dry=True)
        later = dry(plan, Path(folder), first.world_s + first.later_s)
        answers = judge(first, later).answers
        return classes, proposal, {a.holding for a in answers}, answers


def pairs(seeds=20, only=""):
    for label, (*members, world) in PAIRS.items():
        if only and only not in label:
            continue
        for hidden, name in members:
            right, both, kinds, hours, begun = 0, 0, {}, [], time.perf_counter()
            for seed in range(1, seeds + 1):
                classes, proposal, held, _ = loop(hidden, world, seed)
                both += any(len(c) > 1 and name in c for c in classes)
                right += held == {(name,)}
                if proposal is not None:
                    kinds[proposal.variation.what] = kinds.get(proposal.variation.what, 0) + 1
                    hours.append(proposal.hours)
                if held != {(name,)}:
                    print(f"    seed {seed}: {classes} -> {held}")
            print(
                f"{label}, truly {name}: right alone on {right} of {seeds} seeds (with others before on {both}); "
                f"{kinds}, {sum(hours) / max(len(hours), 1):.1f} h; {time.perf_counter() - begun:.0f} s",
                flush=True,
            )


def already(seeds=20):
    """Where shared attitudes tell already: 37 x 13 over +-180 deg, one sensor."""
    for hidden, name, alias in ((PADS, "isolation-pad-deflection", "head-once-per-turn"),
                                (ONCE, "head-once-per-turn", "isolation-pad-deflection")):  # fmt: skip
        right = 0
        for seed in range(1, seeds + 1):
            with tempfile.TemporaryDirectory() as folder:
                first = open_traced(first_run(hidden, {}, seed, Path(folder), WHOLE))
            members = [{m.effect for m in q.members} for q in first.questions]
            right += any(name in m for m in members) and not any(alias in m for m in members)
        print(
            f"37 x 13 over +-180 deg, truly {name}: {alias} excluded without a further run on {right} of {seeds} seeds"
        )


if __name__ == "__main__":
    words = sys.argv[1:]
    seeds = int(words[0]) if words else 20
    if words[1:] != ["already"]:
        pairs(seeds, *words[1:])
    if len(words) < 2 or words[1] == "already":
        already(seeds)
