"""A digital voltmeter (DVM), or another meter with one input, that the bench file describes: any maker's.

Options: docs/how_to/own_instrument.md; an example: `examples/voltmeter-lab/bench.toml`. How a driver of its own is
added: `drivers/__init__.py`.

It is started and fetched as the bench file says. Readings are recognised by a number in the service request mask where
the instrument allows that, as in `rig.drivers.scpi`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from rig.contracts.declared.roles import Reader
from rig.drivers.declared.reader import INPUT, DeclaredReader
from rig.drivers.errors import DriverError
from rig.drivers.numbers import whole
from rig.drivers.scpi_described import Described, ask, tell
from rig.drivers.scpi_options import Command, Question, ScpiOptions, filled


class DescribedMeter(DeclaredReader, Described):
    """The meter; satisfies `rig.drivers.roles.Reader`, `WithUnits`, `Restartable`, `SelfChecking` and `Learning`.

    It has one channel, "input".

    Args:
        name: the bench's name for it.
        address: text address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.
    """

    class Options(ScpiOptions):
        """Options of this instrument in the bench file."""

        start: Annotated[str, AfterValidator(filled("count"))] | None = Field(
            None, description="starts {count} readings that it keeps; left out: each fetch takes one reading"
        )
        fetch: Question = Field("READ?", description="asks for all readings since start, or for one new reading")
        abort: Command | None = Field(None, description="gives up readings under way; left out: device clear only")
        reading_s: float = Field(ge=0.0, le=600.0, description="duration of a reading, seconds")
        most: int = Field(1000, ge=1, le=1_000_000, description="maximum number of readings in its memory")
        numbered: bool = Field(
            True, description="number measurements in *SRE, so that late and other readings are recognised"
        )
        overload: float = Field(
            1e30,
            gt=0.0,
            description="readings of this size or larger are outside the range; the twin's range ends there",
        )

    def _roles(self) -> Mapping[str, Any]:
        options = self._options
        one: dict[str, Any] = {"start": (tell(options.start, count=":d"),)} if options.start else {}
        one |= {"abort": (tell(options.abort),)} if options.abort else {}
        one |= {"number": (tell("*SRE {mark}", mark=":d"),)} if options.numbered else {}
        plain: dict[str, Any] = {key: getattr(options, key) for key in ("unit", "reading_s", "most", "overload")}
        fetch = f"{options.fetch};*SRE?" if options.numbered else options.fetch
        return {"reader": Reader.model_construct(reading=ask(fetch), **one, **plain)}

    def _of_one_form(self, name: str, readings: Sequence[tuple[str, float]]) -> list[float]:
        return [value for _, value in readings] if self._options.digits else super()._of_one_form(name, readings)

    def _sweep(self, failed: dict[str, DriverError]) -> dict[str, tuple[str, float]]:
        self._number()
        return {INPUT: self._readings(1, self._options.reading_s * 1.25 + self._options.timeout_s)[0]}

    def _block(self, count: int) -> dict[str, list[tuple[str, float]]]:
        return {INPUT: self._readings(count, self._due_in(count) + self._options.timeout_s)}

    def _readings(self, count: int, timeout_s: float) -> list[tuple[str, float]]:
        """Ask for readings, as printed and in numbers, and check that they are those of the present number."""
        asked = self._reader.reading
        assert asked is not None
        question, talk = asked.said, self._talk
        words = answer = talk.once(asked, timeout_s=timeout_s, repeat=False).printed
        if self._options.numbered:
            words, _, mark = answer.rpartition(";")
            try:
                ours = whole(mark) == self._mark
            except ValueError:
                raise talk.line.bad_reply(question, answer, "readings and the measurement's mark") from None
            if not ours:
                raise talk.line.bad_reply(question, answer, f"mark {self._mark}: these are other readings")
        form, parts = self._options.number.split(";"), words.split(";")
        at = next(n for n, part in enumerate(form) if "{number}" in part)  # of a compound question, the readings' part
        readings = parts[at].split(",") if len(parts) == len(form) else []
        if len(readings) != count:
            raise talk.line.bad_reply(question, answer, f"{count} numbers")
        return [
            self._value(*talk.printed_in(question, ";".join([*parts[:at], one, *parts[at + 1 :]]))) for one in readings
        ]
