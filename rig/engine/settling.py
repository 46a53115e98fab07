"""When a quantity has settled: inside its band, for the dwell time, and without drift.

A sample outside the band shortens the dwell counted so far; it does not reset it. So one spike does not cost a whole
dwell, and a value that keeps leaving the band never settles. Samples are neither filtered nor masked: they are the
evidence.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

Outcome = Literal["waiting", "settled", "timed-out", "drifting"]
_KEPT = 200
"""Maximum number of samples kept as evidence; a longer trace is thinned, but keeps its first and last samples."""

SETPOINT_STANDS = 0.05
"""A setpoint this close to the command is the commanded one: instruments round to tenths or hundredths of a degree."""


class Criteria(NamedTuple):
    """Criteria of settling, in the quantity's own unit; drift is per second."""

    target: float
    band: float
    dwell_s: float
    drift_per_s: float
    timeout_s: float


class Settling:
    """Judges one quantity sample by sample.

    Args:
        criteria: criteria of settling.
        started: clock time at the start of waiting; the timeout counts from here.

    """

    def __init__(self, criteria: Criteria, started: float) -> None:
        self.criteria = criteria
        self._started = started
        self._inside_s = 0.0
        self._last: float | None = None
        self._was_inside = False
        self._samples: list[tuple[float, float]] = []
        self._dwell_from = 0
        self.outcome: Outcome = "waiting"

    def add(self, now: float, value: float) -> Outcome:
        """Take a sample made at clock time `now`. A settled quantity may leave its band again; a failure is final."""
        if self.outcome in ("timed-out", "drifting"):
            return self.outcome
        target, band, dwell_s, drift_per_s, timeout_s = self.criteria
        inside, waited = abs(value - target) <= band, now - self._started
        step = 0.0 if self._last is None else now - self._last  # by the clock: polls may be late or missing
        if not inside:
            self._inside_s = max(0.0, self._inside_s - step)
        elif self._was_inside:  # time before the band is reached does not count
            so_far = self._inside_s + step
            self._inside_s = so_far if so_far < dwell_s else dwell_s
        self._last, self._was_inside = now, inside
        self._samples.append((waited, value))
        stayed = inside and self._inside_s >= dwell_s - 1e-9  # sums of clock differences round
        if stayed and abs(self._slope()) <= drift_per_s:
            self.outcome = "settled"
        elif waited >= timeout_s:
            self.outcome = "drifting" if stayed else "timed-out"
        else:
            self.outcome = "waiting"
        return self.outcome

    def idle_s(self) -> float:
        """Seconds in which the outcome will hardly change, for a forecast: zero near a change.

        Outside the band half of the time to it at the present speed, since approaches slow down, but an eighth of the
        time so far at most. Inside it zero: drift is the slope over the whole dwell, so every sample counts.
        """
        c, samples = self.criteria, self._samples
        if self._was_inside or len(samples) < 2:
            return 0.0
        (before, first), (now, last) = samples[-2:]
        nearer = abs(first - c.target) - abs(last - c.target)
        if nearer <= 0.0:
            return 0.0
        return min(0.5 * (abs(last - c.target) - c.band) * (now - before) / nearer, now / 8.0)

    def missed(self, now: float) -> None:
        """Note a missing sample at clock time `now`: the time next to it does not count."""
        self._last, self._was_inside = now, False

    def _slope(self) -> float:
        """Least-squares slope of the samples inside the band over the last dwell, per second.

        In one pass, by updates of the means and of sums of squares and products about them (Welford, 1962).
        """
        c = self.criteria
        samples = self._samples
        since = samples[-1][0] - c.dwell_s - 1e-9
        while samples[self._dwell_from][0] < since:  # a soak has thousands of samples: the older ones are passed once
            self._dwell_from += 1
        count, mean_t, mean_v, spread, joint = 0, 0.0, 0.0, 0.0, 0.0
        for t, value in samples[self._dwell_from :]:
            if abs(value - c.target) <= c.band:
                count += 1
                away = t - mean_t
                mean_t += away / count
                mean_v += (value - mean_v) / count
                spread += away * (t - mean_t)
                joint += away * (value - mean_v)
        return joint / spread if spread else 0.0

    def lately(self, seconds: float, most: int) -> dict[str, object]:
        """The last `seconds`, for observers: criteria, outcome, seconds waited, at most `most` samples as [seconds ago,
        value].
        """
        newest = self._samples[-1][0] if self._samples else 0.0
        shown = [(t - newest, value) for t, value in self._samples if t >= newest - seconds]
        if len(shown) > most:
            step = (len(shown) - 1) / (most - 1)
            shown = [shown[round(i * step)] for i in range(most)]
        return {
            "target": self.criteria.target,
            "band": self.criteria.band,
            "outcome": self.outcome,
            "for_s": round(newest, 1),
            "samples": [[round(t, 1), value] for t, value in shown],
        }

    def evidence(self) -> dict[str, object]:
        """Evidence for the run file: outcome, seconds taken, samples as [seconds, value]."""
        samples = self._samples
        if len(samples) > _KEPT:
            step = (len(samples) - 1) / (_KEPT - 1)
            samples = [samples[round(i * step)] for i in range(_KEPT)]
        return {
            "outcome": self.outcome,
            "seconds": round(samples[-1][0], 3) if samples else 0.0,
            "samples": [[round(t, 3), v] for t, v in samples],
        }
