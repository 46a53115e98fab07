"""A person as an instrument: sets a factor by hand when the run asks for it.

It has no wire. What was set is what the person says with `rig done`; nothing is assumed.
"""

from __future__ import annotations

from typing import ClassVar

from pydantic import BaseModel, ConfigDict, Field, field_validator

from drivers.clock import Clock
from drivers.driver import ContractFile, Medium
from drivers.roles import Identity
from drivers.wires import Wires


class Person:
    """Somebody at the bench; satisfies `drivers.roles.ByHand`.

    Args:
        name: the bench's name, such as "operator".
        address: none.
        options: see `Options`.
        wires: not used.
        clock: not used.

    """

    wire: ClassVar[Medium] = "none"
    contracts: ClassVar[tuple[ContractFile, ...]] = ()

    class Options(BaseModel):
        """Options of this instrument in the bench file."""

        model_config = ConfigDict(extra="forbid", frozen=True)

        say: str = Field(
            "set {factor} to {value}",
            min_length=1,
            max_length=300,
            description="what the person is asked to do; {factor}, {value} and {unit} stand for the setting",
        )

        @field_validator("say")
        @classmethod
        def _says_the_value(cls, say: str) -> str:
            try:
                said = say.format(factor="force_kN", value="5", unit="kN")
            except (LookupError, ValueError, AttributeError):
                raise ValueError("the words in braces are {factor}, {value} and {unit}") from None
            if "{value}" not in say or not said.isprintable():
                raise ValueError("it is shown to a person: one line, with {value} in it")
            return say

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name, self._say = name, options.say

    def identify(self) -> Identity:
        """A person, whatever the name."""
        return Identity("person", self.name, "", "")

    def instruction(self, factor: str, value: float) -> str:
        """See `ByHand.instruction`."""
        words = factor.split("_")
        unit = "/".join(words[-3::2]) if len(words) > 3 and words[-2] == "per" else words[-1]
        return self._say.format(factor=factor, value=f"{value:.12g}", unit=unit).rstrip(". ")

    def prepare(self) -> None:
        """Nothing is to be prepared."""

    def make_safe(self) -> None:
        """Nothing can be commanded."""

    def close(self) -> None:
        """Nothing is open."""
