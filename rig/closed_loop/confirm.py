"""From a trace to the run that confirms it: what could be done, what it would tell, what it told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from drivers.roles import Chamber
from fitter import AttitudeData
from fitter.attitude import mounting_matrix
from fitter.confirm import (
    NOTHING,
    AttitudeTogether,
    Confirmation,
    Question,
    Separation,
    Together,
    confirm,
    questions_of,
    separation,
)
from fitter.effects import Scene, separate
from procedures import PitchRollProcedure, RunList
from procedures.separating import Variation, variations
from rig.bench import playing
from rig.closed_loop.attitude import AttitudeTraced, trace_attitude_table
from rig.config import BenchConfig
from rig.controller import Plan, plan_of
from rig.engine.run_file import RunReader
from rig.errors import UsageError
from rig.tables import attitude_data, run_table
from rig.toml_text import toml_text

ENOUGH = 6.0
"""Standard errors by which look-alikes should be expected to part: three tell them apart, luck takes up to three."""
TURN_H = 0.5
"""What mounting the package anew costs beside bench time."""
TRAVEL_S_PER_DEG = 0.2
"""What a longer way between points costs; a head at 5 deg/s."""
DAY_S = 86400.0


@dataclass(frozen=True, eq=False)
class Traced:
    """A run that was traced, and what a run after it needs.

    Attributes:
        path: the run file.
        traced: what was found in it.
        data: its observations without outliers.
        questions: an effect found each.
        documents: texts of its files.
        procedure: what was run.
        bench: on which bench.
        dry: whether on twins.
        began_utc_s: when.
        world_s: a dry run: how old its world was at the start.

    """

    path: Path
    traced: AttitudeTraced
    data: AttitudeData
    questions: tuple[Question, ...]
    documents: Mapping[str, str]
    procedure: PitchRollProcedure
    bench: BenchConfig
    dry: bool
    began_utc_s: float
    world_s: float

    @property
    def scene(self) -> Scene:
        """References of the trace."""
        return self.traced.trace.scene

    @property
    def later_s(self) -> float:
        """Seconds from its start to the next hour of the same kind, on a later day, when it is over."""
        return DAY_S * float(np.ceil((self.data.elapsed_s.max() + 3600.0) / DAY_S))

    def beside(self, later: AttitudeData, after_s: float) -> Together:
        """This run and a later one, `after_s` from its start."""
        return AttitudeTogether.of(self.traced.trace, self.traced.data, later, after_s)


@dataclass(frozen=True, eq=False)
class Proposal:
    """A run that could be made, and what it would tell.

    Attributes:
        variation: what is run.
        separations: expected, of every effect found.
        hours: of bench time.

    """

    variation: Variation
    separations: tuple[Separation, ...]
    hours: float

    @property
    def least(self) -> float:
        """Expected separation of the pair that would be nearest, in standard errors."""
        return min((s.least for s in self.separations), default=float("inf"))

    @property
    def parts(self) -> tuple[float | None, float | None]:
        """Expected separation of the nearest pair of look-alikes, None without any, and of the weakest from nothing."""
        every = [(pair, v) for s in self.separations for pair, v in s.sigmas.items()]
        alike = min((v for (_, other), v in every if other != NOTHING), default=None)
        return alike, min((v for (_, other), v in every if other == NOTHING), default=None)

    @property
    def open_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it would not part by enough."""
        return tuple(pair for s in self.separations for pair, v in s.sigmas.items() if v < ENOUGH)

    @property
    def told(self) -> float:
        """How many pairs it would part, those that it would part by less than enough in proportion."""
        return sum(min(v / ENOUGH, 1.0) for s in self.separations for v in s.sigmas.values())

    @property
    def rank(self) -> tuple[float, float]:
        """The best is the least: what it tells comes before what it costs."""
        return -round(self.told, 1), self.cost_h

    @property
    def cost_h(self) -> float:
        """Hours, with those of a person."""
        return self.hours + TURN_H * self.variation.turned

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        run = self.variation.procedure
        return {
            "what": self.variation.what,
            "mounting": run.mounting.model_dump() if run.mounting.turned else None,
            "turn_the_package": self.variation.turned,
            "points": len(run.design.build()),
            "replications": run.replications,
            "hours": self.hours,
            "sigmas": [{"pair": list(pair), "sigmas": v} for s in self.separations for pair, v in s.sigmas.items()],
            "enough": self.least >= ENOUGH,
        }


def open_traced(path: Path) -> Traced:
    """Trace a finished pitch-roll run. Raises `UsageError` where it is none."""
    table = run_table(path) if path.suffix == ".sqlite" else None
    if table is None:
        raise UsageError(
            f"{path} is no run file: a further run is made on the bench of the first, which its file holds"
        )
    if table.kind != "pitch-roll":
        raise UsageError(f"{path} is no pitch-roll calibration; `rig confirm` knows no other yet")
    with RunReader.open(path) as reader:
        documents, genesis = reader.documents(), reader.genesis()
    plan = plan_of(documents, dry=bool(genesis.data["dry"]))
    traced = trace_attitude_table(table)
    whole = traced.data
    kept = np.setdiff1d(np.arange(len(whole)), traced.trace.outliers)
    assert isinstance(plan.procedure, PitchRollProcedure)
    return Traced(
        path=path,
        traced=traced,
        data=whole.take(kept),
        questions=questions_of(traced.trace),
        documents=documents,
        procedure=plan.procedure,
        bench=plan.bench,
        dry=plan.dry,
        began_utc_s=genesis.utc_s,
        world_s=float(genesis.data.get("world_start_s", 0.0)),
    )


def propose(first: Traced) -> tuple[Proposal, ...]:
    """Of every kind of run the one that would tell most for least; the best of all first."""
    chamber = bool(playing(first.bench, Chamber))
    best: dict[str, Proposal] = {}
    for variation in variations(first.procedure, first.bench.limits, chamber=chamber):
        known = best.get(variation.what)
        if known is not None and known.least >= ENOUGH:
            continue  # the smallest that is enough
        run_list = variation.procedure.expand()
        hours = _hours(first, run_list)
        separations = separation(first.beside(planned(first, variation, run_list), first.later_s), first.questions)
        proposal = Proposal(variation, separations, hours)
        if known is None or proposal.rank < known.rank:
            best[variation.what] = proposal
    return tuple(sorted(best.values(), key=lambda proposal: proposal.rank))


def planned(first: Traced, variation: Variation, run_list: RunList) -> AttitudeData:
    """A run as it is expected to go; its outputs are zero and mean nothing."""
    procedure, data = variation.procedure, first.data
    n = len(run_list)
    at = {f.name: i for i, f in enumerate(run_list.factors)}
    setpoints = np.array([p.setpoints for p in run_list.points])
    sides = np.array([p.sides for p in run_list.points])
    elapsed = np.arange(1.0, n + 1.0) * _point_s(first, run_list) + float(data.elapsed_s.min())
    degC = None
    if data.temperatures is not None:
        seconds, seen = data.temperatures
        degC = np.interp(elapsed, seconds, seen) + variation.warmer_degC
    turn = procedure.mounting
    matrix = mounting_matrix(turn.x_deg, turn.y_deg, turn.z_deg)
    return AttitudeData(
        replicate=np.array([p.replication for p in run_list.points]),
        order=np.arange(n),
        elapsed_s=elapsed,
        pitch_deg=setpoints[:, at["pitch_deg"]],
        roll_deg=setpoints[:, at["roll_deg"]],
        sensor_temperature_degC=degC,
        outputs={name: np.zeros(n) for name in data.sensors},
        pitch_side=sides[:, at["pitch_deg"]],
        roll_side=sides[:, at["roll_deg"]],
        mounting=np.broadcast_to(matrix, (n, 3, 3)) if turn.turned else None,
    )


def _point_s(first: Traced, run_list: RunList) -> float:
    """Seconds a point will take: as in the first run, and what the way is longer."""
    executed = np.argsort(first.data.order)
    seconds = float(np.median(np.diff(first.data.elapsed_s[executed])))
    usual = _travel(np.column_stack([first.data.pitch_deg, first.data.roll_deg])[executed])
    return seconds + TRAVEL_S_PER_DEG * max(_travel(np.array([p.setpoints for p in run_list.points])) - usual, 0.0)


def _travel(angles: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Mean way between points of the axis that has further to go, degrees."""
    return float(np.mean(np.max(np.abs(np.diff(angles, axis=0)), axis=1))) if len(angles) > 1 else 0.0


def _hours(first: Traced, run_list: RunList) -> float:
    soak = first.procedure.environment.dwell_s if first.procedure.environment is not None else 0.0
    return (len(run_list) * _point_s(first, run_list) + soak) / 3600.0


def otherwise(first: Traced, proposal: Proposal) -> Iterator[str]:
    """What else would tell apart the pairs of look-alikes that a proposal leaves, a sentence each."""
    members = {m.effect: m.terms[0].effect for q in first.questions for m in q.members}
    for one, other in proposal.open_pairs:
        if other == NOTHING:
            yield f"it would hardly show whether {one} is there at all: it is small for so short a run"
        else:
            yield f"it would hardly tell {one} from {other}; this would: {separate(members[one], members[other])}"


def procedure_text(proposal: Proposal) -> str:
    """The procedure file of a proposal."""
    values = proposal.variation.procedure.model_dump(mode="json", exclude_defaults=True, exclude_none=True)
    return toml_text({"kind": "pitch-roll", **values})


def plan_for(first: Traced, proposal: Proposal, *, dry: bool, bench: str | None, world: str | None) -> Plan:
    """The plan of a proposal on the first run's bench, or on another file of the same bench; texts of files."""
    documents = dict(first.documents) | {"procedure.toml": procedure_text(proposal)}
    documents |= {name: text for name, text in (("bench.toml", bench), ("world.toml", world)) if text is not None}
    if not dry:
        documents.pop("world.toml", None)
    plan = plan_of(documents, dry=dry)
    warmer = proposal.variation.warmer_degC
    if dry and warmer and first.procedure.environment is None:
        plan = replace(plan, truth=_warmer(plan.truth, warmer))
    return plan


def _warmer(truth: Mapping[str, Any], by: float) -> dict[str, Any]:
    """The world on a night when it is warmer, in the laboratory and around the package."""
    lab, enclosure = dict(truth.get("lab", {})), dict(truth.get("enclosure", {}))
    lab["mean_degC"] = lab.get("mean_degC", 21.5) + by
    enclosure["start_setpoint_degC"] = enclosure.get("start_setpoint_degC", 23.0) + by
    return {**truth, "lab": lab, "enclosure": enclosure}


@dataclass(frozen=True, eq=False)
class Confirmed:
    """What a later run told of the effects that were found in a first.

    Attributes:
        first: the run that was traced.
        path: the later run file.
        points: observations in it.
        answers: a question each.

    """

    first: Traced
    path: Path
    points: int
    answers: tuple[Confirmation, ...]

    @property
    def settled(self) -> bool:
        """Whether one explanation is left of every effect."""
        return all(len(answer.holding) == 1 for answer in self.answers)

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {"run": str(self.path), "points": self.points, "effects": [_answer(a) for a in self.answers]}


def judge(first: Traced, later: Path) -> Confirmed:
    """Hold every effect found against a later run. Raises `UsageError` where that is none of the same sensors."""
    table = run_table(later)
    if table.kind != "pitch-roll":
        raise UsageError(f"{later} is no pitch-roll run")
    with RunReader.open(later) as reader:
        genesis = reader.genesis()
    if bool(genesis.data["simulated"]) != first.traced.table.simulated:
        raise UsageError(
            f"one of {first.path} and {later} is simulated, the other is not: they cannot be judged together"
        )
    after_s = genesis.utc_s - first.began_utc_s
    if after_s <= 0:
        raise UsageError(f"{later} began before {first.path}: what confirms an effect has to come after it")
    data = attitude_data(table)
    try:
        both = first.beside(data, after_s)
    except ValueError as error:
        raise UsageError(f"{later}: {error}") from error
    return Confirmed(first, later, len(data), tuple(confirm(both, question) for question in first.questions))


def _answer(answer: Confirmation) -> dict[str, Any]:
    return {
        "named": answer.effect,
        "verdict": answer.verdict,
        "holds": list(answer.holding),
        "own_alignment": answer.realigned,
        "members": [
            {
                "effect": m.effect,
                "sigmas_behind": m.sigmas,
                "p_changed": m.p_changed,
                "terms": list(m.terms),
                "coefficients": list(m.coefficients),
                "interval_95": [list(i) for i in m.intervals],
                "coefficients_both_runs": list(m.together),
                "size": dict(m.sizes),
                "error": {
                    name: {
                        "before_V": e.before,
                        "after_V": e.after,
                        "before_deg": float(np.degrees(e.before / e.slope)),
                        "after_deg": float(np.degrees(e.after / e.slope)),
                        "reading_deg": float(np.degrees(e.sigma / e.slope)),
                    }
                    for name, e in m.errors.items()
                },
            }
            for m in answer.members
        ],
    }


def sentences(confirmed: Confirmed) -> Iterator[str]:
    """What was confirmed, in words that can go into a certificate."""
    for answer in confirmed.answers:
        yield _sentence(answer)


def _sentence(answer: Confirmation) -> str:
    best = answer.members[0]
    name, error = max(best.errors.items(), key=lambda item: item[1].before / max(item[1].after, 1e-300))
    before, after = (float(np.degrees(v / error.slope)) for v in (error.before, error.after))
    errors = (
        f"On data that neither model has seen the error of {name} is {before:.3g} deg rms with the declared model and "
        f"{after:.3g} deg with the effects."
    )
    if answer.verdict == "confirmed":
        others = [m.effect for m in answer.members[1:]]
        excluded = f"; {_listed(others)} {'is' if len(others) == 1 else 'are'} excluded" if others else ""
        return f"{answer.effect} is confirmed by a further run{excluded}. {errors}"
    if answer.verdict == "replaced":
        return f"What was named {answer.effect} is {best.effect}: a further run tells them apart. {errors}"
    if answer.verdict == "undecided":
        return f"A further run leaves {_listed(answer.holding)} undecided. {errors}"
    return (
        f"{_listed([m.effect for m in answer.members])}: not of one size in both runs. What was found is something "
        f"else, or it changed between them. {errors}"
    )


def _listed(names: Sequence[str]) -> str:
    return " and ".join(names) if len(names) < 3 else ", ".join(names[:-1]) + " and " + names[-1]
