"""Early warnings: how often they cry wolf over clean dry runs of both laboratories, and how soon they are right.

Clean: the examples' worlds without undeclared effects, in a laboratory whose temperature stands still. What goes wrong
is planted in the observations of such a run from a point on, and the tests are fed with them as the controller does.
"""

from __future__ import annotations

import json
import random
import statistics
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.statistics.dry_runs import dry
from rig.engine.early_warning import EarlyWarnings
from rig.examples import example
from rig.procedures.plan.expected import Previous
from rig.run_file.events.bench import Warned
from rig.run_file.read.reader import RunReader
from rig.runs.plans import load_plan, plan_of
from rig.runs.previous import read_previous

Body = dict[str, Any]
Spoil = Callable[[str, int, float, Body], None]
Lab = Literal["attitude", "pressure"]

LABS: Mapping[Lab, tuple[str, int]] = {"attitude": ("x_V", 400), "pressure": ("bridge_3_mV", 50)}
"""The output that is spoilt, and from which point on."""
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


def _world(lab: Lab, seed: int) -> str:
    if lab == "attitude":
        return ATTITUDE.format(seed=seed)
    text = (example("pressure-lab") / "world.toml").read_text().split("[effects.third_order_pressure]")[0]
    text = text.replace("daily_amplitude_degC = 2.0", "daily_amplitude_degC = 0")
    return text.replace("seed = 20080703", f"seed = {seed}")


class Night:
    """The observations of a run, to be fed again and again, and the calibration that it gives."""

    def __init__(self, path: Path) -> None:
        self.calibration = read_previous(path)
        with RunReader.open(path) as reader:
            self.run_list = reader.run_list()
            self.conduct = plan_of(reader.documents(), dry=True, stored=True).procedure.conduct
            observed = list(reader.records("observation"))
        self.records = [(r.run_index or 0, r.whole_plot, r.elapsed_s, r.body) for r in observed]

    @classmethod
    def of(cls, lab: Lab, seed: int) -> Night:
        """A clean dry run: the same sensors, on a night of its own."""
        files = example(f"{lab}-lab")
        with tempfile.TemporaryDirectory() as made:
            world = Path(made) / "world.toml"
            world.write_text(_world(lab, seed))
            plan = load_plan(files / "procedure.toml", files / "bench.toml", dry=True, world=world)
            return cls(dry(plan, Path(made)))

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
    """Give a channel other readings."""
    mean = statistics.fmean(readings)
    channel |= {"mean": mean, "sd": statistics.stdev(readings), "readings": readings}


def spoilt(sensor: str, since: int, rng: random.Random, since_s: float) -> dict[str, tuple[str, Spoil]]:
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


def alarms() -> Study:
    """False alarms of clean runs, each held against the calibration from the run of the seed before; 1 has none."""
    return Study({lab: partial(_alarms, lab=lab) for lab in LABS}, _wolves)


def _alarms(seed: int, lab: Lab) -> Result:
    previous = Night.of(lab, seed - 1).calibration if seed > 1 else None
    night = Night.of(lab, seed)
    told = [[at, warned.message] for at, warned in night.feed(None, previous)]
    return {"seed": seed, "points": len(night.records), "told": told}


def _wolves(results: Results) -> Figures:
    when = {f"seed {one['seed']}": one["told"] for one in results if one["told"]}
    return {"false alarm": len(when), "of": len(results), "points": sum(one["points"] for one in results), "in": when}


def planted() -> Study:
    """How soon what goes wrong is told: points and hours."""
    return Study({lab: partial(_planted, lab=lab) for lab in LABS}, _soon)


def _planted(seed: int, lab: Lab) -> Result:
    night, (sensor, since) = Night.of(lab, seed), LABS[lab]
    since_s = night.records[since][2]
    out: Result = {}
    for what, (cause, spoil) in spoilt(sensor, since, random.Random(seed), since_s).items():
        previous = night.calibration if cause == "calibration" else None
        told = [(at, w) for at, w in night.feed(spoil, previous) if w.output == sensor and w.cause == cause]
        out[what] = None
        if told:
            at, warned = told[0]
            hours = (night.records[at][2] - since_s) / 3600.0
            out[what] = {"points": at - since + 1, "hours": hours, "message": warned.message}
    return {"of what": out}


def _soon(results: Results) -> Figures:
    out: Figures = {}
    for what in results[0]["of what"]:
        told = [one["of what"][what] for one in results if one["of what"][what] is not None]
        out[what] = {"told": len(told), "of": len(results)}
        if told:
            points, hours = (statistics.median(one[name] for one in told) for name in ("points", "hours"))
            out[what] |= {"points": points, "hours": hours, "first": told[0]["message"]}
    return out


PARTS = {"alarms": Part(alarms, 20, 1), "planted": Part(planted, 1, 1)}
