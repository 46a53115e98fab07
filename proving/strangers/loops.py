"""Loops on a bench with physics of strangers: is the right cause confirmed, a wrong one, or nothing?

python -m proving strangers loops [--set FOLDER] [--only bubble] [--size 2] --seeds 1

The cause of a stranger's attitude laboratory is added to every reading of one simulated sensor: of a pose, its time and
what went before. Each loop has one such cause, of a size in standard deviations of a row, and the judge's list of its
set says which names are right. The bench makes its further runs alone.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from proving.loops import Silent
from proving.strangers.judge import Judged, judge_of
from proving.strangers.sets import StrangerSet, load
from rig.bench.config import parse_toml
from rig.engine.session import Signals
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.fitter.arrays import FloatArray
from rig.loop import start_loop
from rig.loop.evaluation import Evaluation
from rig.runs.controller import Site, opened, start_run
from rig.runs.plans import Plan, load_plan
from rig.tables.table_of_run import run_table

KIND, OUTPUT, HOURS = "attitude", "y_V", 16.0
PITCHES = [15.0 * k - 75.0 for k in range(11)]
ROLLS = [60.0 * k for k in range(-2, 4)]


@dataclass(frozen=True)
class Sensor:
    """The simulated sensor as a stranger sees it.

    Attributes:
        feel: gravity in a stranger's axes from pitch and roll, degrees.
        axis: unit vector of the sensor in these axes.
        gain: V/g.
        sd: standard deviation of a row, V.
    """

    feel: Callable[[FloatArray, FloatArray], FloatArray]
    axis: FloatArray
    gain: float
    sd: float

    @classmethod
    def of(cls, feel: Callable[..., FloatArray], columns: Mapping[str, FloatArray]) -> Sensor:
        """By a run with nothing hidden."""
        model = _model(feel(columns["pitch_deg"], columns["roll_deg"]))
        rest, fit = _rest(columns[OUTPUT], model, columns["replicate"])
        gain = float(np.linalg.norm(fit[1:]))
        return cls(feel, fit[1:] / gain, gain, float(np.sqrt(np.mean(rest**2))))


def _model(feel: FloatArray) -> FloatArray:
    return np.column_stack([np.ones(len(feel)), feel])


def _rest(y: FloatArray, model: FloatArray, groups: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What a fit of each replication leaves, and the coefficients of the first."""
    rest, fits = np.array(y, float), []
    for group in np.unique(groups):
        rows = groups == group
        fits.append(np.linalg.lstsq(model[rows], y[rows], rcond=None)[0])
        rest[rows] = y[rows] - model[rows] @ fits[-1]
    return rest, fits[0]


@dataclass
class Cause:
    """A stranger's cause on the simulated sensor.

    Attributes:
        chosen: the set.
        name: of the cause.
        seed: of its random constants.
        sensor: the sensor.
        scale: V per unit of the stranger's function.
    """

    chosen: StrangerSet
    name: str
    seed: int
    sensor: Sensor
    scale: float = 1.0

    def shape(self, t: FloatArray, pitch: FloatArray, roll: FloatArray, degC: FloatArray, many: int) -> FloatArray:
        """(n,) the stranger's function over the rows of a run; `many` rows a replication."""
        module: Any = self.chosen.modules[KIND]
        n, rep = len(t), np.arange(len(t)) // many
        feel = self.sensor.feel(pitch, roll)
        first = np.arange(n) % many == 0
        fine = np.arange(t[0] - 60.0, t[-1] + 60.0, 30.0)
        known = {
            "n": n, "rep": rep, "times": int(rep[-1]) + 1, "many": many, "t": t, "pitch": pitch, "roll": roll,
            "feel": feel, "grav": feel, "axes": self.sensor.axis[None], "gains": [self.sensor.gain], "celsius": degC,
            "usual": float(np.median(np.diff(t))) if n > 1 else 41.0, "first": first, "span": max(PITCHES),
            "pause": np.where(first, 3600.0, 0.0), "fine": fine, "air": np.interp(fine, t, degC), "temp": degC,
            "responses": [(OUTPUT, self.sensor.gain * feel @ self.sensor.axis, self.sensor.sd)],
        }  # fmt: skip
        world = type("World", (), known)()
        return np.asarray(module.EFFECTS[self.name](world, np.random.default_rng(self.seed), 0), float)

    def scaled(self, size: float, columns: Mapping[str, FloatArray]) -> Cause:
        """With a size in standard deviations of a row, beside the declared model, in a run."""
        many = int(np.sum(columns["replicate"] == columns["replicate"][0]))
        pitch, roll = columns["pitch_deg"], columns["roll_deg"]
        shape = self.shape(columns["elapsed_s"], pitch, roll, columns["sensor_temperature_degC"], many)
        rest, _ = _rest(shape, _model(self.sensor.feel(pitch, roll)), columns["replicate"])
        scale = size * self.sensor.sd / float(np.sqrt(np.mean(rest**2)))
        return Cause(self.chosen, self.name, self.seed, self.sensor, scale)


@dataclass
class Rows:
    """What the sensor went through in a run so far."""

    cause: Cause
    many: int
    t: list[float] = field(default_factory=list)
    pitch: list[float] = field(default_factory=list)
    roll: list[float] = field(default_factory=list)
    degC: list[float] = field(default_factory=list)

    def next(self, t: float, pitch: float, roll: float, degC: float) -> float:
        """What the cause adds at one more row, V."""
        for column, value in ((self.t, t), (self.pitch, pitch), (self.roll, roll), (self.degC, degC)):
            column.append(value)
        t_, pitch_, roll_, degC_ = (np.array(column) for column in (self.t, self.pitch, self.roll, self.degC))
        if len(t_) < 2:
            return 0.0  # strangers take the usual time between rows, which one row does not have
        return self.cause.scale * float(self.cause.shape(t_, pitch_, roll_, degC_, self.many)[-1])


def with_cause(cause: Cause) -> Site:
    """A site whose sensor has the cause."""

    @contextlib.contextmanager
    def haunted(plan: Plan, *, start: float = 0.0) -> Iterator[Any]:
        with opened(plan, start=start) as found:
            bench, clock, _ = found
            reader, channel = bench.sensors[OUTPUT]
            _, thermometer = bench.temperatures["sensor_temperature_degC"]
            scanner: Any = bench.instruments[reader]
            rows, fetch = Rows(cause, len(plan.run_list) // plan.procedure.replications), scanner.fetch

            def added() -> Any:
                read = fetch()
                if len(read[channel]) > 1:  # a sweep for temperatures alone has one reading
                    axes = bench.head.read()
                    more = rows.next(
                        clock.now(), axes["pitch"].position_deg, axes["roll"].position_deg, float(read[thermometer][-1])
                    )
                    read = {**read, channel: [volts + more for volts in read[channel]]}
                return read

            scanner.fetch = added
            yield found

    return Site(haunted)


def laboratory(folder: Path, seed: int) -> None:
    """Write the files of the laboratory: one sensor, 11 pitches and 6 rolls, three replications."""
    lab = example("attitude-lab")
    bench = parse_toml((lab / "bench.toml").read_text(encoding="utf-8"), "bench.toml")
    bench["sensors"] = {"y": bench["sensors"]["y"]}  # across the roll axis, as the first one of strangers
    procedure = parse_toml((lab / "night.toml").read_text(encoding="utf-8"), "night.toml")
    procedure |= {"seed": seed, "replications": 3, "loop": {"between_runs": "safe"}}
    procedure["design"] = {"type": "D", "pitch_deg": PITCHES, "roll_deg": ROLLS}
    for name, values in (("bench", bench), ("procedure", procedure), ("world", {"seed": 1000 + seed})):
        (folder / f"{name}.toml").write_text(toml_text(values), encoding="utf-8")
    (folder / "equipment.toml").write_bytes((lab / "equipment.toml").read_bytes())


def quiet(folder: Path) -> Mapping[str, FloatArray]:
    """Columns of a run in which nothing is hidden."""
    plan = load_plan(folder / "procedure.toml", folder / "bench.toml", dry=True, world=folder / "world.toml")
    how: dict[str, Any] = {"signals": Signals(), "announce": lambda _: None, "on_progress": lambda _: None}
    return run_table(start_run(plan, folder, run_id="quiet", **how).path).columns


def verdict_of(judged: Judged, named: list[str]) -> str:
    """ "right", "right by a near name", "wrong" or "open"."""
    if not named:
        return "open"
    if not all(judged.names(name) for name in named):
        return "wrong"
    return "right by a near name" if all(judged.only_near(name) for name in named) else "right"


def one_loop(seed: int, folder: Path, name: str, size: float) -> str:
    """Conduct a loop; its verdict and answers in words."""
    chosen = load(folder)
    module: Any = chosen.modules[KIND]
    feel = getattr(module, "upward", None) or module.gravity
    (judged,) = judge_of(chosen).of(KIND, [name])
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        laboratory(folder, seed)
        columns = quiet(folder)
        cause = Cause(chosen, name, seed, Sensor.of(feel, columns)).scaled(size, columns)
        (folder / "loop").mkdir()
        program = start_loop(
            folder / "procedure.toml", folder / "bench.toml", folder / "loop", hours=HOURS, dry=True,
            world=folder / "world.toml", announce=lambda _path, _plan: None, signals=Signals(),
            on_progress=lambda _: None, told=Silent(), certified=False, site=with_cause(cause),
        ).program  # fmt: skip
        evaluation = Evaluation(program)
        told, first = evaluation.told, evaluation.first
        traced = ", ".join(found.effect for one in first.traced.outcomes for found in one.named) or "no name"
        assert program.closed is not None
        if told is None:
            return f"open; trace: {traced}; no further run: {program.closed.why}"
        settled = [one for one in told.answers if one.verdict in ("confirmed", "replaced")]
        named = [cause for one in settled for cause in one.holding[0].split(" with ")]
        error = max(told.judged.errors.values(), key=lambda one: one.before / one.sigma)
        answers = "; ".join(f"{one.effect}: {one.verdict} {'/'.join(one.holding)}" for one in told.answers)
        errors = f"error {error.before / error.sigma:.2f} before, {error.after / error.sigma:.2f} after"
        return f"{verdict_of(judged, named)}; trace: {traced}; {answers}; {errors}; {program.closed.why}"
