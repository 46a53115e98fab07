"""Loops in simulated worlds with one to three undeclared effects: are the true causes confirmed by morning, and at what
cost?

python -m proving loops [--seeds 10] [--kind voltmeter|voltmeter-two|...]

Each loop is a dry one of 14 h in a world of its own seed and sizes of the effects, without a certificate. Printed of
each kind: loops of which the trace found an effect; with every true cause confirmed and no other (right), with a part
of them, with a wrong one, or with all left open; errors on the further runs with the declared model and with the
effects, over the scatter of a row; bench hours over those of the whole design twice.
"""

from __future__ import annotations

import random
import statistics
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from rig.bench.config import parse_toml
from rig.engine.session import Signals
from rig.errors import UsageError
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.fitter.confirm.prediction import prediction_errors
from rig.loop import Program, start_loop
from rig.loop.evaluation import Evaluation
from rig.run_file.chain import Record
from rig.verbs.confirm import open_traced, traces_kept

HOURS = 14.0
Values = dict[str, Any]


@dataclass(frozen=True)
class World:
    """One loop's world.

    Attributes:
        bench: values of the bench file, with `procedure` and `truth`.
        true: names that are right, of each effect.
        sizes: true coefficient of an effect by its name, in the unit of the trace, where it is a plain one.
    """

    bench: Values
    procedure: Values
    truth: Values
    true: tuple[frozenset[str], ...]
    sizes: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> frozenset[str]:
        """Names that are right, of any effect."""
        return frozenset().union(*self.true)


@dataclass(frozen=True)
class Outcome:
    """Figures of one loop; None where no further run was made.

    Attributes:
        found: whether the trace of the first run asks about a true effect.
        verdict: "right", "part", "wrong", "open", or "no further run".
        holds: the answers, in words.
        before: error of the worst sensor on the further runs with the declared model, over the scatter.
        after: the same with the effects of the loop.
        traced: the same with the effects that the trace of the first run names.
        by_trace: the same verdict by these names alone.
        hours: bench hours of all runs, over those of the whole design twice.
        held: by confirmed effect of known size, whether the 95 % intervals by the further runs alone, and by all
            runs together, have it.
        said: why the loop was closed.
    """

    found: bool
    verdict: str
    holds: str
    before: float | None
    after: float | None
    hours: float
    traced: float | None = None
    by_trace: str = ""
    held: tuple[tuple[str, bool, bool], ...] = ()
    said: str = ""


class Silent:
    """Is told what a loop does, and says nothing."""

    def run_begins(self, path: Path) -> None:
        """A run begins."""

    def says(self, record: Record) -> None:
        """A record of the loop."""


def _lab(name: str, seed: int, procedure: str = "procedure.toml") -> tuple[Values, Values, Values, random.Random]:
    folder = example(name)
    files = (folder / one for one in ("bench.toml", procedure, "world.toml"))
    bench, plan, truth = (parse_toml(one.read_text(encoding="utf-8"), one.name) for one in files)
    return bench, {**plan, "seed": seed}, {**truth, "seed": 1000 + seed}, random.Random(seed)


def voltmeter(seed: int) -> World:
    """Two of six ranges have an offset of 30 to 100 uV, at a scatter of 15 uV of a reading."""
    bench, procedure, truth, rng = _lab("voltmeter-lab", seed)
    size = rng.uniform(3e-5, 1e-4)
    truth["sensors"]["meter"]["hidden"] = f"{size!r}*min(max(1e6*(abs(input_V) - 12), 0), 1)"
    return World(bench, procedure, truth, (frozenset({"range-step:input_V"}),), {"range-step:input_V": size})


def load_cell(seed: int) -> World:
    """The cell creeps, by 0.3 to 1.2 parts in a thousand; somebody is there to set the weights."""
    bench, procedure, truth, rng = _lab("load-cell-lab", seed)
    truth["sensors"]["cell"]["hidden"] = f"-{rng.uniform(0.00015, 0.0006)!r}*creep"
    truth["lags"]["creep"]["time_constant_s"] = rng.uniform(120, 400)
    return World(bench, procedure, truth, (frozenset({"creep:force_kN"}),))


def attitude(seed: int) -> World:
    """One sensor, pitch alone: soft pads, or an eccentric head, which look alike in the first run."""
    bench, procedure, _, rng = _lab("attitude-lab", seed, "night.toml")
    bench["sensors"] = {"x": bench["sensors"]["x"]}
    procedure |= {"replications": 3, "design": {"type": "D", "pitch_deg": [20.0 * k - 180 for k in range(19)]}}
    procedure["design"]["roll_deg"] = [0.0]
    sizes = {}
    if seed % 2:
        size = rng.uniform(5e-4, 1.2e-3)
        effects: Values = {"isolation_pad": {"pitch_compliance_deg_per_g": size}}
        true = "isolation-pad-deflection"
        sizes = {true: size}
    else:
        head = {"axis": "pitch", "amplitude_arcsec": rng.uniform(1.5, 4.0), "periods_per_turn": 1.0}
        effects, true = {"head_error": [head]}, "head-once-per-turn"
    return World(bench, procedure, {"seed": 1000 + seed, "effects": effects}, (frozenset({true}),), sizes)


def pressure(seed: int) -> World:
    """Transducers with hysteresis, in a shorter design."""
    bench, procedure, truth, rng = _lab("pressure-lab", seed)
    procedure["design"] |= {"centre": 2}
    truth["effects"] = {"hysteresis": {"uV": dict.fromkeys(bench["sensors"], rng.uniform(8.0, 20.0))}}
    return World(bench, procedure, truth, (frozenset({"hysteresis"}),))


def voltmeter_two(seed: int) -> World:
    """The offset of two ranges, and a cubic error of 0.1 to 0.4 mV at full scale."""
    world = voltmeter(seed)
    meter = world.truth["sensors"]["meter"]
    size = random.Random(seed + 500).uniform(1e-4, 4e-4)
    meter["hidden"] += f" + {size!r}*(input_V/1000)^3"
    sizes = {**world.sizes, "third-order:input_V": size * 1e-9}
    return replace(world, true=(*world.true, frozenset({"third-order:input_V"})), sizes=sizes)


def load_cell_two(seed: int) -> World:
    """The cell creeps, and rising and falling series differ: both are a memory of the load."""
    world = load_cell(seed)
    size = random.Random(seed + 500).uniform(5e-5, 2e-4)
    world.truth["sensors"]["cell"]["hidden"] += f" + {size!r}*force_side"
    sizes = {"direction:sign(force_side)": size}
    return replace(world, true=(*world.true, frozenset({"direction:sign(force_side)"})), sizes=sizes)


def load_cell_three(seed: int) -> World:
    """The same, and a cubic error of 0.5 to 2 mV at full load."""
    world = load_cell_two(seed)
    size = random.Random(seed + 900).uniform(5e-4, 2e-3)
    world.truth["sensors"]["cell"]["hidden"] += f" + {size!r}*(force_kN/10)^3"
    sizes = {**world.sizes, "third-order:force_kN": size * 1e-3}
    return replace(world, true=(*world.true, frozenset({"third-order:force_kN"})), sizes=sizes)


def attitude_six(seed: int) -> World:
    """The same with six replications, the fewest that the paper recommends."""
    world = attitude(seed)
    return replace(world, procedure={**world.procedure, "replications": 6})


def attitude_two(seed: int) -> World:
    """Pads and an eccentric head at once, which look alike in the first run."""
    pads, head = attitude(2 * seed + 1), attitude(2 * seed)
    effects = {**pads.truth["effects"], **head.truth["effects"]}
    return replace(pads, truth={**pads.truth, "effects": effects}, true=(*pads.true, *head.true))


def attitude_warm(seed: int) -> World:
    """Pads, and a sensitivity that follows the temperature: the two of the paper, one sensor, with roll."""
    world = attitude(2 * seed + 1)
    world.procedure["design"] |= {"pitch_deg": [30.0 * k - 180 for k in range(13)], "roll_deg": [0.0, 90.0, 180.0]}
    warm = {"ppm_per_degC": random.Random(seed).uniform(150.0, 400.0), "reference_degC": 23}
    world.truth["effects"]["sensitivity_temperature"] = warm
    return replace(world, true=(*world.true, frozenset({"sensitivity-temperature"})))


def attitude_three(seed: int) -> World:
    """The same, and play of the gear behind the encoder."""
    world = attitude_warm(seed)
    size = random.Random(seed + 900).uniform(2.0, 5.0)
    world.truth["effects"]["backlash"] = {"pitch_arcsec": size}
    sizes = {**world.sizes, "backlash-pitch": size / 3600.0}
    return replace(world, true=(*world.true, frozenset({"backlash-pitch"})), sizes=sizes)


def pressure_two(seed: int) -> World:
    """Transducers with hysteresis, and an offset that drifts along the run."""
    world = pressure(seed)
    world.truth["effects"]["carry_over"] = {"pct": random.Random(seed).uniform(0.1, 0.4), "time_constant_s": 120}
    return replace(world, true=(*world.true, frozenset({"carry-over"})))


def voltmeter_clean(seed: int) -> World:
    """Nothing is undeclared: whatever is confirmed is wrong."""
    world = voltmeter(seed)
    del world.truth["sensors"]["meter"]["hidden"]
    return replace(world, true=(), sizes={})


def attitude_clean(seed: int) -> World:
    """The same."""
    world = attitude(seed)
    return replace(world, truth={**world.truth, "effects": {}}, true=(), sizes={})


KINDS: dict[str, Callable[[int], World]] = {
    "voltmeter": voltmeter, "load-cell": load_cell, "attitude": attitude, "pressure": pressure,
    "voltmeter-two": voltmeter_two, "load-cell-two": load_cell_two, "load-cell-three": load_cell_three,
    "attitude-six": attitude_six, "attitude-two": attitude_two, "attitude-warm": attitude_warm,
    "attitude-three": attitude_three, "pressure-two": pressure_two,
    "voltmeter-clean": voltmeter_clean, "attitude-clean": attitude_clean,
}  # fmt: skip


def files_of(kind: str, world: World, folder: Path) -> None:
    """Write bench, procedure, world and register of a loop."""
    procedure = world.procedure | {"loop": {"allow": _allowed(kind)}}
    for file, values in (("bench", world.bench), ("procedure", procedure), ("world", world.truth)):
        (folder / f"{file}.toml").write_text(toml_text(values), encoding="utf-8")
    for register in example(f"{_lab_of(kind)}-lab").glob("equipment.toml"):
        (folder / register.name).write_bytes(register.read_bytes())


def loop_in(folder: Path, hours: float = HOURS, **how: Any) -> Program:
    """Conduct the loop of a folder."""
    return start_loop(
        folder / "procedure.toml", folder / "bench.toml", folder, hours=hours,
        dry=True, world=folder / "world.toml", announce=lambda _path, _plan: None, signals=Signals(),
        on_progress=lambda _: None, told=Silent(), certified=False, **how,
    ).program  # fmt: skip


def one_loop(kind: str, seed: int) -> Outcome:
    """Conduct a loop; its figures."""
    world = KINDS[kind](seed)
    with tempfile.TemporaryDirectory() as name, traces_kept():
        files_of(kind, world, Path(name))
        program = loop_in(Path(name), 72.0 if _lab_of(kind) == "pressure" else HOURS)
        runs = [run.ended.took_s for run in program.runs if run.ended is not None]
        hours = sum(runs) / (2.0 * runs[0])
        first = open_traced(program.file_of(program.runs[0]))
        found = any(set(_names(q)) & world.names for q in first.questions)
        told = Evaluation(program).told
        if told is None:
            return Outcome(found, "no further run", "", None, None, hours)
        settled = [one for one in told.answers if one.verdict in ("confirmed", "replaced")]
        verdict = verdict_of(world, [set(one.holding[0].split(" with ")) for one in settled])
        errors = told.judged.errors.values()
        worst = max(errors, key=lambda one: one.before / one.sigma)
        holds = "; ".join(f"{one.effect}: {one.verdict} {'/'.join(one.holding)}" for one in told.answers)
        *earlier, last = told.later
        both = first.confirming.after(earlier).beside(last.data, last.after_s, last.done)
        traced, _ = prediction_errors(both, {q.effect: q.terms for q in first.questions})
        by_trace = [{found.effect} for one in first.traced.outcomes for found in one.named if found.kind == "effect"]
        assert program.closed is not None
        return Outcome(
            found, verdict, holds, worst.before / worst.sigma, worst.after / worst.sigma, hours,
            traced=max(one.after / one.sigma for one in traced.values()), by_trace=verdict_of(world, by_trace),
            held=tuple(_held(world, settled)), said=program.closed.why,
        )  # fmt: skip


def verdict_of(world: World, named: Sequence[set[str]]) -> str:
    """Verdict on sets of causes, one of each effect that is taken to be known."""
    if not all(one <= world.names for one in named):
        return "wrong"
    if all(any(own & one for one in named) for own in world.true):
        return "right"
    return "part" if named else "open"


def _held(world: World, settled: Sequence[Any]) -> Iterator[tuple[str, bool, bool]]:
    """Whether both intervals of each confirmed plain effect have its true size, whatever its sign's convention."""
    for answer in settled:
        best = next(one for one in answer.members if one.effect == answer.holding[0])
        true = world.sizes.get(best.effect)
        if true is not None:
            yield (
                best.effect,
                *(
                    any(low <= sign * true <= high for sign in (1.0, -1.0))
                    for low, high in (best.intervals[0], best.intervals_together[0])
                ),
            )


LABS = ("voltmeter", "load-cell", "attitude", "pressure")


def _lab_of(kind: str) -> str:
    return next(name for name in LABS if kind.startswith(name))


def _median(values: Sequence[float]) -> float:
    return statistics.median(values) if values else float("nan")


def _names(question: Any) -> Sequence[str]:
    return [member.effect for member in question.members]


def _allowed(kind: str) -> list[str]:
    return [
        "again",
        "order",
        "settings",
        "temperature",
        "wait",
        *(["person"] if not kind.startswith("pressure") else []),
    ]


def loops(kind: str = "") -> Study:
    """Dry loops in worlds of a kind, or of each: what is confirmed, errors, hours, sizes."""
    if kind and kind not in KINDS:
        raise UsageError(f"--kind {kind}: there are {', '.join(KINDS)}")
    return Study({one: partial(_loop, kind=one) for one in ([kind] if kind else KINDS)}, _figures)


def _loop(seed: int, kind: str) -> Result:
    return {"seed": seed, **asdict(one_loop(kind, seed))}


def _figures(results: Results) -> Figures:
    words = ("right", "part", "wrong", "open", "no further run")
    held = [one for loop in results for one in loop["held"]]
    medians = {
        name: _median([one[key] for one in results if one[key] is not None])
        for name, key in (("error before", "before"), ("after", "after"), ("by the trace alone", "traced"),
                          ("hours, of the whole design twice", "hours"))
    }  # fmt: skip
    return {
        "found": sum(one["found"] for one in results),
        **{word: sum(one["verdict"] == word for one in results) for word in words},
        "by the trace of the first run alone": {w: sum(one["by_trace"] == w for one in results) for w in words[:4]},
        **medians,
        "intervals of confirmed sizes": len(held),
        "that hold by further runs": sum(one[1] for one in held),
        "by all runs": sum(one[2] for one in held),
        "loops that say that error is left": sum("but the error" in one["said"] for one in results),
        "of": len(results),
        "which": {f"seed {one['seed']}": f"{one['verdict']} ({one['holds']})" for one in results},
    }


PARTS = {"": Part(loops, 10, 1)}
