"""The role of a person at a bench: does what no instrument can do.

A real person answers by `rig done`. A simulated one (`rig.simulated.person`) does it in the simulated bench.
"""

from __future__ import annotations

from typing import Protocol

from procedures.by_hand import HandStep


class Person(Protocol):
    """A simulated person."""

    def asked(self, step: HandStep) -> bool:
        """The person reads what to do. Returns whether somebody is there to do it."""
        ...

    def answer(self) -> tuple[str | None, str] | None:
        """Stated value and name, once the step is done; None before. The bench is changed from then on."""
        ...

    def asked_to_set(self, factor: str, value: float) -> bool:
        """The person reads to what a factor has to be set. Returns as `asked`; the answer is then that of `answer`."""
        ...

    def recall_setting(self, factor: str, value: float) -> None:
        """A real person has set a factor of a simulated bench."""
        ...

    def recall(self, change: str, number: float | None) -> None:
        """A step was done in an earlier session: the bench is still changed."""
        ...
