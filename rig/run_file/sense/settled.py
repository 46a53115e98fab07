"""Whether evidence of settling is any: samples that stay within their band, for the dwell, without drift."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

_KEPT = 200
"""Of a longer trace so many samples are kept, evenly: what lay between them is not known."""
_ROUNDED_S = 0.001
_ROUNDING = 1e-9
_SLOPE = 1.02
"""By so much at most a slope differs for the rounding of its times."""


@dataclass(frozen=True)
class Asked:
    """When something has settled; drift is per second."""

    target: float
    band: float
    dwell_s: float
    drift_per_s: float


def unsettled(name: str, evidence: Mapping[str, Any], asked: Asked) -> Iterator[str]:
    """Why evidence shows nothing settled, though it says so: ends of sentences.

    Args:
        name: of what settled.
        evidence: outcome, seconds taken, samples as [seconds, value].
        asked: when it has settled.

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


def _inside_s(samples: Sequence[tuple[float, float]], asked: Asked) -> float:
    """Seconds within the band, those outside taken off: as the controller counts, or more where samples are missing."""
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


def _slope(samples: Sequence[tuple[float, float]], asked: Asked, more_s: float) -> float:
    """Of the last dwell and `more_s`: at its edge rounding says whether a sample is in it."""
    since = samples[-1][0] - asked.dwell_s - more_s
    recent = [s for s in samples if s[0] >= since and abs(s[1] - asked.target) <= asked.band + _ROUNDING]
    mean_s = sum(t for t, _ in recent) / max(len(recent), 1)
    spread = sum((t - mean_s) ** 2 for t, _ in recent)
    if not spread:
        return 0.0
    mean = sum(v for _, v in recent) / len(recent)
    return sum((t - mean_s) * (v - mean) for t, v in recent) / spread
