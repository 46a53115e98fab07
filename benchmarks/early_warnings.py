"""Early warnings: how often they cry wolf over clean dry runs of both laboratories, and how soon they are right.

    python benchmarks/early_warnings.py --runs 20 --synthetic 1000

Clean: the examples' worlds without undeclared effects, in a laboratory whose temperature stands still. What goes wrong
is planted in the observations of such a run from a point on, and the tests are fed with them as the controller does.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from procedures.expected import Previous
from rig.controller import start_run
from rig.engine.early_warning import EarlyWarnings, Warned
from rig.engine.session import Signals
from rig.examples import example
from rig.plans import load_plan, plan_of
from rig.previous import read_previous
from rig.run_file.reader import RunReader

Body = dict[str, Any]
Spoil = Callable[[str, int, float, Body], None]

ATTITUDE = """
seed = {seed}
[sensors.x]
noise_V = 25e-6
coning_deg = 0.2
[sensors.y]
noise_V = 25e-6
coning_deg = 0.3
[sensors.z]
noise_V = 25e-6
[lab]
daily_amplitude_degC = 0
"""


def pressure_world(seed: int) -> str:
    lines = (example("pressure-lab") / "world.toml").read_text().split("[effects.third_order_pressure]")[0]
    lines = lines.replace("daily_amplitude_degC = 2.0", "daily_amplitude_degC = 0")
    return lines.replace("seed = 20080703", f"seed = {seed}")


def dry(lab: str, seed: int, folder: Path) -> Path:
    """A clean dry run; the run file."""
    world = folder / f"{lab}.toml"
    world.write_text(ATTITUDE.format(seed=seed) if lab == "attitude-lab" else pressure_world(seed))
    plan = load_plan(example(lab) / "procedure.toml", example(lab) / "bench.toml", dry=True, world=world)
    made: list[Path] = []
    start_run(plan, folder, signals=Signals(), announce=made.append, on_progress=lambda _: None)
    return made[0]


class Night:
    """The observations of a run, to be fed again and again."""

    def __init__(self, path: Path) -> None:
        with RunReader.open(path) as reader:
            self.run_list = reader.run_list()
            self.conduct = plan_of(reader.documents(), dry=True, stored=True).procedure.conduct
            observed = list(reader.records("observation"))
        self.records = [(r.run_index or 0, r.whole_plot, r.elapsed_s, r.body) for r in observed]

    def feed(self, spoil: Spoil | None, previous: Previous | None) -> Iterator[tuple[int, Warned]]:
        """Warnings, each with the number of the observation that gave it."""
        warnings = EarlyWarnings(self.run_list, previous, self.conduct)
        for number, (index, whole_plot, elapsed_s, text) in enumerate(self.records):
            body = json.loads(text)
            if spoil is not None:
                for name, channel in body["outputs"].items():
                    spoil(name, number, elapsed_s, channel)
            for warning in warnings.add(self.run_list.points[index], whole_plot, body):
                yield number, warning


def reread(channel: Body, readings: list[float]) -> None:
    mean = statistics.fmean(readings)
    channel |= {"mean": mean, "sd": statistics.stdev(readings), "readings": readings}


def planted(sensor: str, since: int, rng: random.Random, since_s: float) -> dict[str, tuple[str, Spoil]]:
    """What goes wrong, by name, with the cause that should be named."""
    held: dict[str, float] = {}

    def noisier(times: float) -> Spoil:
        def spoil(name: str, number: int, _s: float, channel: Body) -> None:
            if name == sensor and number >= since:
                mean = channel["mean"]
                reread(channel, [mean + times * (r - mean) for r in channel["readings"]])

        return spoil

    def frozen(name: str, number: int, _s: float, channel: Body) -> None:
        if name == sensor and number >= since:
            value = held.setdefault("frozen", channel["readings"][0])
            reread(channel, [value] * len(channel["readings"]))

    def noise_around(level: float) -> Spoil:
        def spoil(name: str, number: int, _s: float, channel: Body) -> None:
            if name == sensor and number >= since:
                reread(channel, [level + rng.gauss(0.0, 1e-4) for _ in channel["readings"]])

        return spoil

    def half(name: str, number: int, _s: float, channel: Body) -> None:
        if name == sensor and number >= since:
            reread(channel, [r / 2 for r in channel["readings"]])

    def shifted(by: float, per_h: float) -> Spoil:
        def spoil(name: str, number: int, s: float, channel: Body) -> None:
            if name == sensor and number >= since:
                shift = by + per_h * (s - since_s) / 3600.0
                reread(channel, [r + shift for r in channel["readings"]])

        return spoil

    uV = 1e-6 if sensor.endswith("_V") else 1e-3
    return {
        "noise 1.5 times": ("noise", noisier(1.5)),
        "noise 2 times": ("noise", noisier(2.0)),
        "noise 4 times": ("noise", noisier(4.0)),
        "frozen": ("response", frozen),
        "open, noise around 0": ("response", noise_around(0.0)),
        "at a rail": ("response", noise_around(12.0)),
        "half the sensitivity": ("response", half),
        "offset drifts by 10 uV/h": ("drift", shifted(0.0, 10 * uV)),
        "offset drifts by 40 uV/h": ("drift", shifted(0.0, 40 * uV)),
        "offset drifts by 40 uV/h, calibration named": ("calibration", shifted(0.0, 40 * uV)),
        "offset steps by 100 uV, calibration named": ("calibration", shifted(100 * uV, 0.0)),
        "offset steps by 300 uV, calibration named": ("calibration", shifted(300 * uV, 0.0)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, help="clean dry runs of each laboratory")
    parser.add_argument("--synthetic", type=int, default=1000, help="runs of normal readings fed straight to the tests")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for lab in ("attitude-lab", "pressure-lab"):
            alarms(lab, asked.runs, asked.seed, folder)
    synthetic(asked.synthetic, asked.seed)


def alarms(lab: str, runs: int, seed: int, folder: Path) -> None:
    """Clean runs, each held against the calibration from the one before; then what is planted in the last of them."""
    previous: Previous | None = None
    wolf: list[tuple[int, int, str]] = []
    night, points = None, 0
    for number in range(runs):
        path = dry(lab, seed + number, folder)  # the same sensors on another night: noise has another seed
        night = Night(path)
        points += len(night.records)
        wolf += [(number, at, w.message) for at, w in night.feed(None, previous)]
        previous = read_previous(path)
        path.unlink()
    print(f"{lab}: {runs} clean runs, {points} points: {len({n for n, _, _ in wolf})} with a false alarm")
    for number, at, message in wolf:
        print(f"  run {number}, point {at}: {message}")
    assert night is not None
    since, since_s = 400 if lab == "attitude-lab" else 50, 0.0
    since_s = night.records[since][2]
    sensor = "x_V" if lab == "attitude-lab" else "bridge_3_mV"
    for what, (cause, spoil) in planted(sensor, since, random.Random(seed), since_s).items():
        held = previous if cause == "calibration" else None
        told = [(at, w) for at, w in night.feed(spoil, held) if w.output == sensor and w.cause == cause]
        if told:
            later_h = (night.records[told[0][0]][2] - since_s) / 3600.0
            print(f"  {what}: after {told[0][0] - since + 1} points, {later_h:.1f} h: {told[0][1].message}")
        else:
            print(f"  {what}: not told")


def synthetic(runs: int, seed: int) -> None:
    """Runs of normal readings at the attitude laboratory's points: the rate that was aimed at is below 1 %."""
    plan = load_plan(example("attitude-lab") / "procedure.toml", example("attitude-lab") / "bench.toml", dry=True)
    rng, wolf = random.Random(seed), 0
    for _ in range(runs):
        warnings = EarlyWarnings(plan.run_list, None, plan.procedure.conduct)
        found: list[Warned] = []
        for point in plan.run_list.points:
            outputs: dict[str, Body] = {}
            for name in ("x_V", "y_V", "z_V"):
                readings = [rng.gauss(0.0, 5e-5) for _ in range(10)]
                reread(outputs.setdefault(name, {}), readings)
            found += [w for w in warnings.add(point, None, {"outputs": outputs}) if w.cause != "response"]
        wolf += bool(found)
    print(f"normal readings, 3 sensors, {len(plan.run_list)} points: {wolf} of {runs} runs with a false alarm")


if __name__ == "__main__":
    main()
