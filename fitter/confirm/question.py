"""What a trace leaves open: for every effect it found, the explanations its data could not tell apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.attitude import attitude_columns
from fitter.data import AttitudeData
from fitter.temperature import Temperature
from fitter.trace import SensorTrace, Trace
from fitter.trace.problem import Candidate


@dataclass(frozen=True)
class Hypothesis:
    """One member of a class.

    Attributes:
        effect: name in the catalogue.
        terms: its terms, on the sensors they concern.
        sigmas: standard errors by which it falls behind the best in the run that was traced.

    """

    effect: str
    terms: tuple[Candidate, ...]
    sigmas: float


@dataclass(frozen=True, eq=False)
class Question:
    """An effect that was found, and what else it may be.

    Attributes:
        members: explanations the data of the run cannot tell apart, the one it named first.
        rest: terms of the other effects found; they stay in the model.

    """

    members: tuple[Hypothesis, ...]
    rest: tuple[Candidate, ...]

    @property
    def effect(self) -> str:
        """The one that was named."""
        return self.members[0].effect


@dataclass(frozen=True, eq=False)
class Noise:
    """How readings and replications of one sensor scatter beside the effects found.

    Attributes:
        sigma_V: standard deviation of one reading.
        df: degrees of freedom it is known with.
        spread: (k,) variance of a replication's own parameters, each over `sigma_V`^2; zero where they do not drift.
        temperature: what temperature adds in the declared model; None where that has none.

    """

    sigma_V: float
    df: int
    spread: FloatArray
    temperature: Temperature | None


def questions_of(found: Trace) -> tuple[Question, ...]:
    """One for every effect that was found, in the order of its size."""
    shares: dict[str, float] = {}
    for sensor in found.sensors.values():
        for effect in sensor.effects:
            shares[effect.effect] = max(effect.share, shares.get(effect.effect, 0.0))
    asked = []
    for name in sorted(shares, key=lambda effect: -shares[effect]):
        alike = [Hypothesis(e.effect, e.terms, e.sigmas) for e in found.explanations[name] if e.alias]
        alike.sort(key=lambda member: (member.effect != name, member.sigmas))
        asked.append(Question(tuple(alike), tuple(c for c in found.chosen if c.effect.name != name)))
    return tuple(asked)


def noise_of(found: Trace, data: AttitudeData) -> Mapping[str, Noise]:
    """Of every sensor, from the run that was traced (`data`, all of its rows).

    The variance of a replication's own parameters is what their scatter is beyond that of readings. It is no better
    known than a variance on a few degrees of freedom; zero with a single replication.
    """
    kept = np.setdiff1d(np.arange(len(data)), found.outliers)
    return {name: _noise(sensor, data, kept) for name, sensor in found.sensors.items()}


def _noise(sensor: SensorTrace, data: AttitudeData, kept: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Noise:
    table = sensor.after
    known = np.isfinite(table.sigma_pr)
    sigma = table.sigma_pr if known else table.sigma_E
    df = (table.n_replications - 1) * (table.n_points - len(sensor.fit.names)) if known else sensor.fit.df
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=data.has_roll)[kept]
    rest, replicate = sensor.residual_after_V[kept], data.replicate_index[kept]
    own, spread = [], []
    for index in np.unique(replicate):
        rows = h[replicate == index]
        if rows.shape[0] > rows.shape[1]:
            inverse = np.linalg.pinv(rows)
            own.append(inverse @ rest[replicate == index])
            spread.append(np.sum(inverse**2, axis=1))
    beyond = np.zeros(h.shape[1])
    if len(own) > 1:
        beyond = np.maximum(np.var(np.array(own), axis=0, ddof=1) / sigma**2 - np.mean(spread, axis=0), 0.0)
    return Noise(float(sigma), max(int(df), 1), beyond, sensor.temperature)
