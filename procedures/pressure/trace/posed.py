"""A whole-plot run posed for the engine: the components of its error, and every candidate as a block of columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.beside import Errors, White
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.family import TableFamily
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.problem import Candidate
from rig.fitter.trace.engine.problem import Problem as Blocks
from rig.fitter.trace.engine.rivalry import Rivalry
from rig.fitter.trace.engine.score import ranked
from rig.fitter.trace.engine.sensors import OfSensor, RunJudge, Stacked, Together
from rig.fitter.trace.engine.shared import scale_of
from rig.fitter.trace.engine.term import Profile, TableTerm
from rig.procedures.pressure.trace.problem import Problem

NEAR = 6.0
"""Log-likelihood by which a covariance may be behind the best beside the model, or beside one of `TRIED` candidates."""
TRIED = 10


class Posed(NamedTuple):
    """Attributes of a `RunJudge`."""

    alone: tuple[OfSensor, ...]
    own: tuple[IntArray, ...]
    together: Together | None
    covariances: BoolArray


def engine_of(run: Problem, known: RunJudge | None) -> Posed:
    """The run for the engine.

    Args:
        run: with its weights.
        known: the same run with other weights: its covariances and its simulations are used again. Scores are nearly
            pivotal: weights of readings hardly change how they are distributed by chance.
    """
    count = len(run.sensors)
    commons = [j for j, c in enumerate(run.candidates) if c.sensor is None]
    noises = [
        Components.of(run.whole_plot, run.order, run.pressure_psia, scale_of(run.whole_plot, y, run.model))
        for y in run.outputs
    ]
    own = [
        np.array([j for j, c in enumerate(run.candidates) if c.sensor == s or (c.sensor is None and count == 1)], int)
        for s in run.sensors
    ]
    sd = run.sd
    families = count + bool(commons) if count > 1 else 1
    made = [
        Blocks(
            y=run.outputs[i],
            declared=run.model,
            candidates=tuple(candidate(run, int(j), run.raw[i][:, [j]]) for j in own[i]),
            noise=noises[i].over(sd[i]),
            sd=sd[i],
            ordered=False,
            sensors=families,
            effort=1.0 / count,
        )
        for i in range(count)
    ]
    same = known is not None and known.alone[0].problem.n == len(run.declared)
    before = known if same else None
    kept = np.any([_near(one) for one in made], axis=0) if before is None else before.covariances
    noises = [noise.among(kept) for noise in noises]
    simulated: dict[bytes, dict[tuple[int, Rivalry], TableFamily]] = {}
    alone = [
        OfSensor(
            replace(one, noise=noise.over(one.sd)),
            simulated.setdefault(noise.grid.tobytes(), {}) if before is None else before.alone[i].families,
        )
        for i, (one, noise) in enumerate(zip(made, noises, strict=True))
    ]
    together = None
    if count > 1 and commons:
        families_of_all = {} if before is None or before.together is None else before.together.families
        together = Together(_stacked(run, alone, noises, sd), families_of_all, alone=tuple(alone))
    return Posed(tuple(alone), tuple(own), together, kept)


def _stacked(run: Problem, alone: Sequence[TableJudge], noises: Sequence[Components], sd: FloatArray) -> Blocks:
    """All transducers, each over its error, with offsets as far as each of them has."""
    count = len(alone)
    likely = [one.beside(()) for one in alone]
    sigma = np.sqrt([one.sigma2[one.best] for one in likely])
    offsets = np.array([one.grid[b.best, 0] for one, b in zip(noises, likely, strict=True)])
    offsets = np.maximum(offsets, offsets.max() / 20.0) if offsets.max() > 0.0 else np.ones(count)
    offsets /= np.exp(np.mean(np.log(offsets)))
    each = (sd * sigma[:, None]).ravel()
    each /= np.exp(np.mean(np.log(each)))
    parts = tuple(one.stretched(float(o)) for one, o in zip(noises, offsets, strict=True))
    return Blocks(
        y=run.outputs.ravel(),
        declared=np.asarray(np.kron(np.eye(count), run.model), np.float64),
        candidates=tuple(candidate(run, j, run.raw[:, :, j].reshape(-1, 1)) for j in range(len(run.candidates))),
        noise=Stacked(parts, (run.outputs.shape[1],) * count).over(each),
        sd=each,
        ordered=False,
        sensors=alone[0].problem.sensors,
        effort=1.0 / count,
    )


def candidate(run: Problem, j: int, columns: FloatArray) -> Candidate:
    """One of the run, with its columns (n, 1)."""
    one = run.candidates[j]
    term = alone = TableTerm((one.term.name,), columns)
    if one.effect.searched:  # its values are those of the catalogue: none is between two of them
        term = replace(term, profile=Profile(float(j), float(j), float(j), lambda _: alone))
    return Candidate(one.effect, term, one.sensor, one.effect.sign(one.term.name), one.effect.at_most)


def _near(problem: Blocks) -> BoolArray:
    """(G,) covariances that are near the best beside the declared model, or beside a candidate, and the first."""
    judge = TableJudge(problem)
    plain = judge.beside(())
    kept = plain.reml > plain.reml.max() - NEAR
    kept[0] = True
    if not problem.candidates:
        return np.asarray(kept)
    tried: dict[int, None] = {}
    for at in dict.fromkeys((0, plain.best)):
        worth = ranked(judge.view(at), judge.white(at, ()), ()).evidence
        best: dict[str, int] = {}
        for j in ties.descending(worth).tolist():
            best.setdefault(problem.candidates[j].effect.name, j)
            if len(best) == TRIED:
                break
        tried |= dict.fromkeys(best.values())
    reml = judge.each(list(tried))
    return np.asarray(kept | np.any(reml > reml.max(axis=0) - NEAR, axis=1))


def white_of(run: Problem, covariances: FloatArray) -> White:
    """The run over errors of each transducer: variances of offsets and of slopes, correlation of neighbours (S, 3)."""
    noise = Components.of(run.whole_plot, run.order, run.pressure_psia)
    errors = tuple(
        Errors(replace(noise, grid=one[None]).over(sd), sd) for one, sd in zip(covariances, run.sd, strict=True)
    )
    return White(errors, run.model, run.outputs, run.raw)
