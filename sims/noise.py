"""Noise as a function of an event, not of a stream.

A random number is a pure function of (seed, channel, event). The same event always gets the same noise, however often
an instrument is polled and in whatever order twins are asked, in another process too.

Source: splitmix64 (Steele, Lea and Flood, OOPSLA 2014) as the hash; Box and Muller (1958) for the normal deviate.
"""

from __future__ import annotations

import math
from functools import lru_cache
from hashlib import blake2b

_MASK = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15
_TO_UNIT = 2.0**-53


@lru_cache(maxsize=4096)
def _stream(seed: int, channel: str) -> int:
    digest = blake2b(f"{seed}/{channel}".encode(), digest_size=8).digest()
    return int.from_bytes(digest, "little")


def splitmix64(state: int) -> int:
    """The 64-bit output of splitmix64 for a 64-bit state (the state is advanced once before mixing)."""
    z = (state + _GOLDEN) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


def uniform(seed: int, channel: str, event: int) -> float:
    """A number in [0, 1) for this event of this channel; 53 random bits."""
    return (splitmix64((_stream(seed, channel) + event * _GOLDEN) & _MASK) >> 11) * _TO_UNIT


def normal(seed: int, channel: str, event: int) -> float:
    """A standard normal deviate for this event of this channel.

    Args:
        seed: the world's seed.
        channel: name of the noise source; channels are independent of one another.
        event: number of the event, any integer; for a reading, its time in whole microseconds of virtual time.
    """
    # `splitmix64` twice, written out: nearly all readings of a simulated night pass here
    z = (_stream(seed, channel) + (event + 1) * _GOLDEN) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    first = z ^ (z >> 31)
    z = (first + _GOLDEN) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    second = z ^ (z >> 31)
    radius = math.sqrt(-2.0 * math.log(1.0 - (first >> 11) * _TO_UNIT))
    return radius * math.cos(2.0 * math.pi * (second >> 11) * _TO_UNIT)


def event_at(seconds: float) -> int:
    """Event number of a virtual time: whole microseconds, so that rounding of floats cannot shift it."""
    return round(seconds * 1e6)
