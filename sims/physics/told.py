"""Listeners to commands (`rig.sims.tape`)."""

from __future__ import annotations

from typing import Protocol


class Told(Protocol):
    """Called with a command, or with a state that was reached."""

    def __call__(self, what: str, value: float | str, after_s: float = 0.0, /) -> None:
        """This value holds from now on, or after this many seconds unless another command comes before."""
        ...
