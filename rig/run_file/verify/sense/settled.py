"""Validity of settling evidence: samples stay within their band, for the dwell time, without drift."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

_KEPT = 200
"""Number of samples kept of a longer trace, evenly spaced; values between them are unknown."""
_ROUNDED_S = 0.001
_ROUNDING = 1e-9
_SLOPE = 1.02
"""Maximum relative error of a slope by rounding of its times."""


@dataclass(frozen=True)
class SettlingCriteria:
    """Criteria of settling; drift is per second."""

    target: float
    band: float
    dwell_s: float
    drift_per_s: float


def unsettled(name: str, evidence: Mapping[str, Any], asked: SettlingCriteria) -> Iterator[str]:
    """Contradictions between settling evidence and its outcome: ends of sentences.

    Args:
        name: name of the settled quantity.
        evidence: outcome, seconds taken, samples as [seconds, value].
        asked: criteria of settling.

    """
    samples: Sequence[tuple[float, float]] = evidence["samples"]
    if evidence["seconds"] < asked.dwell_s - _ROUNDED_S:
        yield f"{name} settled within {evidence['seconds']:g} s, less than its dwell of {asked.dwell_s:g} s"
        return
    if any(later <= earlier for (earlier, _), (later, _) in pairwise(samples)) or samples[0][0] < -_ROUNDED_S:
        yield f"times of the samples by which {name} settled do not go on"
        return
    if abs(samples[-1][0] - evidence["seconds"]) > 2.0 * _ROUNDED_S:
        yield f"{name} settled within {evidence['seconds']:g} s, and its last sample is of {samples[-1][0]:g} s"
        return
    if len(samples) >= _KEPT:
        return
    inside_s = _inside_s(samples, asked)
    if inside_s < asked.dwell_s - _ROUNDED_S * len(samples):
        yield f"{name} was within {asked.band:g} of {asked.target:g} for {inside_s:.1f} s, not {asked.dwell_s:g}"
        return
    most = _SLOPE * asked.drift_per_s
    slope = _slope(samples, asked, _ROUNDED_S)
    if abs(slope) > most and abs(_slope(samples, asked, -_ROUNDED_S)) > most:
        yield f"{name} drifted by {slope:.2g} a second at the end of its settling, and {asked.drift_per_s:.2g} is asked"


def _inside_s(samples: Sequence[tuple[float, float]], asked: SettlingCriteria) -> float:
    """Seconds within the band, minus those outside: as the controller counts, or more if samples are missing."""
    inside_s, before = 0.0, False
    last = samples[0][0]
    for seconds, value in samples:
        inside = abs(value - asked.target) <= asked.band + _ROUNDING
        if not inside:
            inside_s = max(0.0, inside_s - (seconds - last))
        elif before:
            inside_s = min(inside_s + seconds - last, asked.dwell_s)
        last, before = seconds, inside
    return inside_s


def _slope(samples: Sequence[tuple[float, float]], asked: SettlingCriteria, more_s: float) -> float:
    """Slope over the last dwell time and `more_s`: rounding decides whether a sample at the edge is inside."""
    since = samples[-1][0] - asked.dwell_s - more_s
    recent = [s for s in samples if s[0] >= since and abs(s[1] - asked.target) <= asked.band + _ROUNDING]
    mean_s = sum(t for t, _ in recent) / max(len(recent), 1)
    spread = sum((t - mean_s) ** 2 for t, _ in recent)
    if not spread:
        return 0.0
    mean = sum(v for _, v in recent) / len(recent)
    return sum((t - mean_s) * (v - mean) for t, v in recent) / spread
