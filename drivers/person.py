"""A person as an instrument: sets a factor by hand, or reads a dial, when the run asks for it.

It has no wire. What was set or read is what the person says with `rig done`; nothing is assumed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import NotReady
from rig.drivers.roles import Identity
from rig.drivers.wires import Wires


class Person:
    """Somebody at the bench; satisfies `rig.drivers.roles.ByHand`, and `Reader` and `WithUnits` by what was typed.

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

        reads: dict[str, str] = Field(
            default_factory=dict,
            description='unit of each channel that the person reads and types, by channel: `{ dial = "bar" }`',
        )
        resolution: dict[str, Annotated[float, Field(gt=0.0)]] = Field(
            default_factory=dict,
            description="how finely each of these channels can be read, in its unit: `{ dial = 0.02 }`",
        )
        twice: bool = Field(
            False,
            description="every reading is asked for twice, and a third time if the two differ by more than the "
            "resolution and the procedure's limit of scatter",
        )

        @model_validator(mode="after")
        def _resolutions(self) -> Self:
            if odd := sorted(self.reads.keys() ^ self.resolution.keys()):
                raise ValueError(f"reads and resolution name the same channels; {', '.join(odd)} is in one only")
            return self

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
        self.name, self._say, self._units = name, options.say, options.reads
        self._typed: dict[str, Sequence[float]] = {}

    def identify(self) -> Identity:
        """A person, whatever the name."""
        return Identity("person", self.name, "", "")

    def instruction(self, factor: str, value: float) -> str:
        """The task, to set a factor (with its unit at the end, as in tables) to a value: a sentence without a full
        stop.
        """
        words = factor.split("_")
        unit = "/".join(words[-3::2]) if len(words) > 3 and words[-2] == "per" else words[-1]
        return self._say.format(factor=factor, value=f"{value:.12g}", unit=unit).rstrip(". ")

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        return tuple(self._units)

    def units(self) -> Mapping[str, str]:
        """Unit of each channel's readings, by channel, as at the end of column names ("mV", "kN", "ohm")."""
        return self._units

    def take(self, typed: Mapping[str, Sequence[float]]) -> None:
        """Take what was typed for the present point, by channel, in the channels' units."""
        self._typed = dict(typed)

    def start(self, count: int) -> float:
        """Start readings: everything has been read before."""
        return 0.0

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """The readings: what was typed, whatever number of readings instruments take. Raises `NotReady`."""
        if not self._typed:
            raise NotReady(f"{self.name}: nothing was typed")
        return self._typed

    def prepare(self) -> None:
        """Nothing is to be prepared."""

    def make_safe(self) -> None:
        """Nothing can be commanded."""

    def close(self) -> None:
        """Nothing is open."""
