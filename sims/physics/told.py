"""Who wants to know what is commanded (`sims.tape`)."""

from __future__ import annotations

from typing import Protocol


class Told(Protocol):
    """Told of what is commanded, or reached."""

    def __call__(self, what: str, value: float | str, after_s: float = 0.0, /) -> None:
        """From now on, or in so many seconds unless something else comes before, this is so."""
        ...
