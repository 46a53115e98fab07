"""When a quantity has arrived: inside its band, for long enough, and no longer drifting.

Samples outside the band count the dwell back instead of resetting it, so that one spike does not cost a whole
dwell while a value that keeps leaving the band never settles. Nothing is filtered, masked or invented: what was
sampled is the evidence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Outcome = Literal["waiting", "settled", "timed-out", "drifting"]
_KEPT = 200
"""Samples kept as evidence; a longer trace is thinned, its first and last samples always staying."""

SETPOINT_STANDS = 0.05
"""A setpoint within this of what was commanded is that one; instruments keep tenths or hundredths of a degree."""


@dataclass(frozen=True)
class Criteria:
    """What settled means. Units are the quantity's own; drift is per second."""

    target: float
    band: float
    dwell_s: float
    drift_per_s: float
    timeout_s: float


class Settling:
    """Judges one quantity sample by sample.

    Args:
        criteria: what settled means.
        started: clock time at which waiting began; the timeout counts from here.

    """

    def __init__(self, criteria: Criteria, started: float) -> None:
        self.criteria = criteria
        self._started = started
        self._inside_s = 0.0
        self._last: float | None = None
        self._was_inside = False
        self._samples: list[tuple[float, float]] = []
        self.outcome: Outcome = "waiting"

    def add(self, now: float, value: float) -> Outcome:
        """Take a sample made at clock time `now`. What has settled may leave its band again; a failure is final."""
        if self.outcome in ("timed-out", "drifting"):
            return self.outcome
        c = self.criteria
        inside = abs(value - c.target) <= c.band
        step = 0.0 if self._last is None else now - self._last
        if not inside:
            self._inside_s = max(0.0, self._inside_s - step)
        elif self._was_inside:  # time on the way in does not count
            self._inside_s = min(self._inside_s + step, c.dwell_s)
        self._last, self._was_inside = now, inside
        self._samples.append((now - self._started, value))
        if inside and self._inside_s >= c.dwell_s - 1e-9 and abs(self._slope()) <= c.drift_per_s:
            self.outcome = "settled"
        elif now - self._started >= c.timeout_s:
            self.outcome = "drifting" if inside and self._inside_s >= c.dwell_s - 1e-9 else "timed-out"
        else:
            self.outcome = "waiting"
        return self.outcome

    def missed(self, now: float) -> None:
        """A sample that should have been made at clock time `now` is missing: the time around it does not count."""
        self._last, self._was_inside = now, False

    def _slope(self) -> float:
        """Least-squares slope of the samples inside the band over the last dwell, per second."""
        c = self.criteria
        since = self._samples[-1][0] - c.dwell_s - 1e-9
        recent = [s for s in self._samples if s[0] >= since and abs(s[1] - c.target) <= c.band]
        n = len(recent)
        mean_t = sum(t for t, _ in recent) / n
        spread = sum((t - mean_t) ** 2 for t, _ in recent)
        if spread == 0.0:
            return 0.0
        mean_v = sum(v for _, v in recent) / n
        return sum((t - mean_t) * (v - mean_v) for t, v in recent) / spread

    def lately(self, seconds: float, most: int) -> dict[str, object]:
        """The last `seconds` for whoever watches: criteria, outcome, `most` samples at most as [seconds ago, value]."""
        newest = self._samples[-1][0] if self._samples else 0.0
        shown = [(t - newest, value) for t, value in self._samples if t >= newest - seconds]
        if len(shown) > most:
            step = (len(shown) - 1) / (most - 1)
            shown = [shown[round(i * step)] for i in range(most)]
        return {
            "target": self.criteria.target,
            "band": self.criteria.band,
            "outcome": self.outcome,
            "samples": [[round(t, 1), value] for t, value in shown],
        }

    def evidence(self) -> dict[str, object]:
        """What was seen, for the run file: outcome, seconds taken, samples as [seconds, value]."""
        samples = self._samples
        if len(samples) > _KEPT:
            step = (len(samples) - 1) / (_KEPT - 1)
            samples = [samples[round(i * step)] for i in range(_KEPT)]
        return {
            "outcome": self.outcome,
            "seconds": round(samples[-1][0], 3) if samples else 0.0,
            "samples": [[round(t, 3), v] for t, v in samples],
        }
