"""A bridge as a line of text: a question is an attribute, `voltage = 5` sets one, `shutdown()` calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from rig.drivers.bridges import Bridge, Value
from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, NoReply
from rig.drivers.wires import Tap
from rig.drivers.wires.serial_line import Whole

IDENTITY = "identity"
LOOK_AGAIN_S = 0.1  # until a value is looked at again that has not been renewed; chosen
_OPENING_S = 60.0  # longest wait for a library to be imported and its driver to be made; chosen


def not_renewed(what: str, value: str, seconds: float) -> str:
    """The sentence about a value that nobody has measured anew."""
    return (
        f"{what} is {value}, and has not been renewed for {seconds:g} s: is its device on, and is it measured by "
        f"itself? Increase wire.timeout_s if it is measured less often"
    )


class BridgeLine:
    """A line for a talk in lines of text, over a bridge.

    Args:
        bridge: the bridge.
        where: the instrument and its address, for messages.
        label: name of the instrument.
        fresh: whether a question is for a reading, which has to be a new one.
        timeout_s: longest wait for an answer, bench seconds.
        clock: bench time.
        tap: called for every question and answer, as text.
    """

    rs232 = False

    def __init__(
        self,
        bridge: Bridge,
        where: str,
        label: str,
        fresh: Callable[[str], bool],
        timeout_s: float,
        clock: Clock,
        tap: Tap | None,
    ) -> None:
        self.where = where
        self.user: object = None
        self._bridge, self._label, self._fresh, self._timeout_s = bridge, label, fresh, timeout_s
        self._clock, self._tap = clock, tap
        self._last: dict[str, float] = {}

    def _told(self, direction: Literal["tx", "rx"], text: str) -> None:
        if self._tap is not None:
            self._tap(self._label, direction, f"{text}\n".encode())

    def write(self, text: str) -> None:
        """Set an attribute or call a method; it has been carried out afterwards. Raises `DriverError`."""
        path, sets, value = text.partition(" = ")
        self._told("tx", text)
        if sets:
            self._bridge.write(path, value, self._timeout_s)
        else:
            self._bridge.call(path, self._timeout_s)

    def query_lines(
        self,
        text: str,
        count: int,
        timeout_s: float | None = None,
        *,
        repeat: bool = True,
        whole: Whole | None = None,
    ) -> list[str]:
        """The value of an attribute as one line, with its unit if the library says it; see `SerialLine.query_lines`."""
        limit = self._timeout_s if timeout_s is None else timeout_s
        self._told("tx", text)
        if text == IDENTITY:
            said = ",".join(part.replace(",", " ") for part in self._bridge.identity(_OPENING_S))
        else:
            found = self._new(text, limit) if self._fresh(text) else self._bridge.read(text, limit)
            said = f"{found.text} {found.unit}".strip()
        self._told("rx", said)
        return [said]

    def _new(self, path: str, timeout_s: float) -> Value:
        """A value that was measured after it was asked for. Raises `NoReply` if none comes."""
        end = self._clock.now() + timeout_s
        found = self._bridge.read(path, timeout_s)
        before = self._last.get(path) if self._bridge.measures_when_asked else found.stamp
        while found.stamp is not None and before is not None and found.stamp <= before:
            if (left := end - self._clock.now()) <= 0:
                raise NoReply(not_renewed(f"{self.where}: {path}", found.text, timeout_s))
            self._clock.sleep(LOOK_AGAIN_S)
            found = self._bridge.read(path, max(left, LOOK_AGAIN_S))
        if found.stamp is not None:
            self._last[path] = found.stamp
        return found

    def beyond(self) -> str:
        """Nothing: a value is a whole answer."""
        return ""

    def heard(self, timeout_s: float, *, onwards: bool = False) -> str:
        """A bridge does not talk by itself."""
        raise NoReply(f"{self.where} does not talk by itself")

    def bad_reply(self, text: str, reply: object, expected: str) -> BadReply:
        """The error for a value that makes no sense."""
        return BadReply(f"{self.where}: {text} is {reply!r}; expected {expected}")

    def drain(self, waiting: int = 0) -> None:
        """Values of attributes do not come late."""

    def device_clear(self, character: str, *, with_dtr: bool) -> None:
        """A library has no such character."""

    def takes_s(self, characters: int) -> float:
        """It has no wire of its own."""
        return 0.0

    def close(self) -> None:
        """Release the bridge; idempotent."""
        self._bridge.close()
