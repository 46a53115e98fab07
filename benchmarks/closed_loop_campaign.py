"""The closed loop through the whole bench, seed after seed: is what was hidden found, and nothing else?

    .venv/bin/python benchmarks/closed_loop_campaign.py hidden --seeds 20     # the example world, night.toml
    .venv/bin/python benchmarks/closed_loop_campaign.py clean --seeds 100     # nothing hidden, procedure.toml

Every seed is a full dry run: drivers, bytes, twins, sequencer, run file; then the trace.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from rig.closed_loop import trace_table
from rig.controller import start_run
from rig.engine.session import Signals
from rig.examples import example
from rig.plans import load_plan
from rig.tables import run_table

LAB = example("attitude-lab")
HIDDEN = {"isolation-pad-deflection", "sensitivity-temperature"}


def found(seed: int, *, hidden: bool) -> dict[str, set[str]]:
    """Effects by sensor that the trace reports after one dry run."""
    text = (LAB / "world.toml").read_text().replace("seed = 20260115", f"seed = {seed}")
    if not hidden:
        text = text[: text.index("# What nobody declared")]
    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "world.toml"
        world.write_text(text)
        procedure = LAB / ("night.toml" if hidden else "procedure.toml")
        plan = load_plan(procedure, LAB / "bench.toml", dry=True, world=world)
        paths: list[Path] = []
        start_run(plan, Path(folder), signals=Signals(), announce=paths.append, on_progress=lambda _: None)
        traced = trace_table(run_table(paths[0]))
    return {name: {effect.effect for effect in s.effects} for name, s in traced.trace.sensors.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("hidden", "clean"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    asked = parser.parse_args()
    named = extra = 0
    for seed in range(asked.first, asked.first + asked.seeds):
        effects = found(seed, hidden=asked.what == "hidden")
        every = set().union(*effects.values())
        named += every >= HIDDEN
        surplus = every - (HIDDEN if asked.what == "hidden" else set())
        extra += bool(surplus)
        print(f"seed {seed}: { ({s: sorted(e) for s, e in effects.items()}) }", flush=True)
    if asked.what == "hidden":
        print(f"both hidden effects named on {named} of {asked.seeds} seeds; anything besides on {extra}")
    else:
        print(f"anything reported on any sensor on {extra} of {asked.seeds} clean seeds")


if __name__ == "__main__":
    main()
