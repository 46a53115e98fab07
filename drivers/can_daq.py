"""A data-acquisition unit on CAN: readings in frames that a DBC file describes.

The DBC defines the frames and the positions of signals in them; the controller program passes it as text. A unit either
measures on command, as in `contracts/can_daq.dbc`, or sends its readings by itself. Only frames that arrive after
`start` count. A frame that repeats the counter of the previous frame is not a reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import ClassVar

from cantools.database.can import Database, Message
from cantools.database.errors import DecodeError, Error
from pydantic import BaseModel, Field, field_validator, model_validator

from rig.contracts.declared.dbc import find_signal, frame_name, read_dbc
from rig.drivers.clock import Clock
from rig.drivers.dbc import Series, Values
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, LimitError, NoReply, NotReady, WrongInstrument
from rig.drivers.roles import Identity
from rig.drivers.wires import Wires

_CHANNELS = {
    "sensor_temperature": "Readings.SensorTemperature",
    "sse_temperature": "Readings.SseTemperature",
    "spare_temperature": "Readings.SpareTemperature",
    "spare_voltage": "Readings.SpareVoltage",
}
_FAULTS = {label: f"{path.replace('Readings', 'Status')}Fault" for label, path in _CHANNELS.items()}

_COMMANDED = {
    "Command": {"Action", "Session", "Sweeps", "Period"},
    "Identity": {"Product", "SerialNumber", "FirmwareMajor", "FirmwareMinor"},
    "Status": {"Session", "Sweep"},
}
"""Messages and signals of a unit that measures on command."""

_SPELLED = {"°C": "degC", "C": "degC", "DegC": "degC", "deg C": "degC"}
"""Units of DBC files, as at the end of column names."""

_SESSIONS, _MOST_SWEEPS = 15, 65_535
"""Numbers that fit into the four and sixteen bits of their signals; see `contracts/can_daq.dbc`."""


class CanDaq:
    """The unit; satisfies `rig.drivers.roles.Reader` and `WithUnits`.

    Args:
        name: the bench's name for it.
        address: CAN address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Attributes:
        retries: number of series with lost frames that were measured again.

    Raises:
        Unreachable: the bus cannot be opened, or another unit on it has the same identifiers.
    """

    wire: ClassVar[Medium] = "can"
    contracts: ClassVar[tuple[ContractFile, ...]] = (ContractFile("dbc", "rig.contracts", "can_daq.dbc"),)

    class Options(BaseModel, extra="forbid"):
        """Options of this instrument in the bench file."""

        channels: dict[str, str] = Field(_CHANNELS, min_length=1, description="channel to its signal, MESSAGE.SIGNAL")
        faults: dict[str, str] = Field(
            _FAULTS, description="channel to the fault signal of its sensor; 0 means no fault"
        )
        on_command: bool = Field(
            True, description="it measures on command, as in contracts/can_daq.dbc; false: it sends by itself"
        )
        counter: str = Field("Sweep", description="signal with the counter of a message, if it has one")
        period_s: float = Field(
            0.1, ge=0.01, le=60.0, description="time between sweeps, or period of the slowest message"
        )
        timeout_s: float = Field(0.5, gt=0, description="maximum delay of a frame")
        dbc: str = Field(description="file with the unit's DBC, beside the bench file")

        @field_validator("dbc")
        @classmethod
        def _readable(cls, text: str) -> str:
            read_dbc(text)
            return text

        @model_validator(mode="after")
        def _consistent(self) -> CanDaq.Options:
            database = read_dbc(self.dbc)
            for label, path in (*self.channels.items(), *self.watched.items()):
                message, _ = find_signal(database, label, path)
                if message.is_extended_frame or message.length > 8:
                    raise ValueError(f"{path}: only classic frames with 11-bit identifiers are supported")
            for name, signals in _COMMANDED.items() if self.on_command else ():
                found = {m.name: {s.name for s in m.signals} for m in database.messages}.get(name)
                if found is None or not signals <= found:
                    raise ValueError(
                        f"a unit that measures on command has a message {name} with {', '.join(sorted(signals))}; "
                        f"the DBC has not: say on_command = false if this one sends by itself"
                    )
            if self.on_command:
                try:
                    for action in ("Stop", "Acquire", "Identify"):
                        _command(database, action, _SESSIONS, 1, self.period_s)
                except (Error, KeyError, ValueError) as error:
                    raise ValueError(f"the unit's Command cannot be sent: {error}") from error
            return self

        @property
        def watched(self) -> dict[str, str]:
            """Fault signals of the used channels."""
            return {label: path for label, path in self.faults.items() if label in self.channels}

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self.retries = 0
        self._options = options
        self._clock = clock
        self._database = read_dbc(options.dbc)
        self._line = wires.can(address, name)
        self._where = self._line.where
        self._channels = {label: find_signal(self._database, label, path) for label, path in options.channels.items()}
        self._faults = {label: find_signal(self._database, label, path) for label, path in options.watched.items()}
        self._most = _MOST_SWEEPS
        if options.on_command:
            sweeps = self._database.get_message_by_name("Command").get_signal_by_name("Sweeps")
            largest = 2**sweeps.length - 1
            self._most = int(min(sweeps.maximum or largest, largest))
        self._session = 0
        self._series: Series | None = None
        self._latest: dict[str, Values] = {}
        self._misfit = ""
        self._measuring = {m.name: m for m, _ in (*self._channels.values(), *self._faults.values())}
        answers = [self._database.get_message_by_name(n) for n in ("Identity", "Status")] if options.on_command else []
        for message in (self._measuring | {m.name: m for m in answers}).values():
            self._line.listen(message.frame_id, partial(self._hear, message))

    def identify(self) -> Identity:
        """Ask for the identity. A unit that sends by itself does not report its identity: its frames identify it."""
        if not self._options.on_command:
            self._listen_for_all()
            message, _ = next(iter(self._channels.values()))
            sender = (message.senders or [""])[0]
            return Identity(self._maker(sender), sender, "", "")
        message = self._database.get_message_by_name("Identity")
        answer = self._asked("Identify", message)
        products = {n: str(text) for n, text in (message.get_signal_by_name("Product").choices or {}).items()}
        product = int(answer["Product"])
        if product not in products:
            known = ", ".join(f"{number} ({text})" for number, text in products.items())
            raise WrongInstrument(f"{self._where} is product {product}; the DBC describes {known or 'none'}")
        return Identity(
            self._maker((message.senders or [""])[0]),
            products[product],
            f"{answer['SerialNumber']:.0f}",
            f"{answer['FirmwareMajor']:.0f}.{answer['FirmwareMinor']:.0f}",
        )

    def prepare(self) -> None:
        """End a running measurement and check that the unit answers; a unit that sends by itself must be sending.

        Raises:
            NoReply: no frame came; the message names the expected identifiers.
        """
        self._series = None
        if self._options.on_command:
            self._asked("Stop", self._database.get_message_by_name("Status"))
        else:
            self._listen_for_all()

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        return tuple(self._channels)

    def units(self) -> Mapping[str, str]:
        """Unit of each channel's readings by the DBC, as at the end of column names; V where it has none."""
        said = {
            label: _SPELLED.get(signal.unit or "", signal.unit or "") for label, (_, signal) in self._channels.items()
        }
        return {label: unit if unit.isalnum() and unit.isascii() else "V" for label, unit in said.items()}

    def start(self, count: int) -> float:
        """Trigger `count` sweeps over all channels; returns the seconds they are expected to take. Earlier frames are
        discarded.

        Raises:
            LimitError: fewer than one sweep, or more than the unit can count.
        """
        if not 1 <= count <= self._most:
            raise LimitError(f"{self._where} can take 1 to {self._most} sweeps at once, not {count}")
        self._begin_anew()
        self._series = Series(count, self._channels, self._faults)
        return self._begin(self._series, count)

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Collect the readings of the last `start`, by channel, waiting for them if necessary. Sweeps with lost frames
        are measured again, once.

        Raises:
            NotReady: nothing was started.
            NoReply: no frame of a message came; the error names it.
            BadReply: frames were lost, repeated their counter or did not fit the DBC.
        """
        series = self._series
        if series is None:
            raise NotReady(f"{self._where}: there is nothing to fetch; start a measurement first")
        try:
            self._until(lambda: not series.missing, series.due)
            if series.missing and self._options.on_command:
                self.retries += 1
                self._begin(series, series.missing)
                self._until(lambda: not series.missing, series.due)
        finally:
            self._series = None
        if series.missing:
            self._raise_incomplete(series)
        return series.readings

    def make_safe(self) -> None:
        """The safe state: a running measurement is given up; nothing else can do harm."""
        self._series = None
        if self._options.on_command:
            self._command("Stop")

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._line.close()

    def _maker(self, sender: str) -> str:
        node = next((n for n in self._database.nodes if n.name == sender), None)
        attribute = node.dbc.attributes.get("Manufacturer") if node and node.dbc else None
        return str(attribute.value) if attribute else ""

    def _begin(self, series: Series, count: int) -> float:
        """Start `count` sweeps; returns their expected duration, seconds."""
        seconds = count * self._options.period_s
        series.due = self._clock.now() + seconds
        series.forget_counters()
        if self._options.on_command:
            self._command("Acquire", count)
        else:
            series.due += self._options.period_s  # the first frame may just have been sent
        return seconds

    def _command(self, action: str, sweeps: int = 0) -> None:
        self._session = self._session % _SESSIONS + 1
        self._line.send(*_command(self._database, action, self._session, sweeps, self._options.period_s))

    def _asked(self, action: str, answer: Message) -> Values:
        """Send a command that is answered by one frame; repeated once if no frame comes."""
        for repeated in (0, 1):
            self.retries += repeated
            self._begin_anew()
            self._command(action)
            self._until(lambda: answer.name in self._latest, self._clock.now())
            if answer.name in self._latest:
                return self._latest[answer.name]
        raise self._silent([answer])

    def _listen_for_all(self) -> None:
        """Wait until every message has been received again. Raises `NoReply` with the names of missing messages."""
        self._begin_anew()
        due = self._clock.now() + 2.0 * self._options.period_s
        self._until(lambda: self._measuring.keys() <= self._latest.keys(), due)
        if unheard := [m for name, m in self._measuring.items() if name not in self._latest]:
            raise self._silent(unheard)

    def _begin_anew(self) -> None:
        """Discard received frames, here and in the adapter."""
        self._line.flush()
        self._latest.clear()
        self._misfit = ""

    def _until(self, done: Callable[[], bool], due: float) -> None:
        """Take frames until a condition holds, or the timeout after its due time has passed."""
        end = due + self._options.timeout_s + self._clock.grace()
        while not done() and (left := end - self._clock.now()) > 0:
            self._line.pump(left)

    def _hear(self, message: Message, data: bytes) -> None:
        try:
            values = {k: float(v) for k, v in message.decode(data, decode_choices=False).items()}  # type: ignore[union-attr, arg-type]  # numbers, since no container and no choices
        except DecodeError as error:
            self._misfit = f"{frame_name(message)} {data.hex()} does not fit the DBC ({error})"
            return
        if self._options.on_command and values.get("Session", self._session) != self._session:
            return
        self._latest[message.name] = values
        if self._series:
            self._series.take(message, values, self._options.counter, in_step=self._options.on_command)

    def _silent(self, messages: Sequence[Message]) -> NoReply:
        expected = ", ".join(frame_name(m) for m in messages)
        return NoReply(
            f"{self._where}: no frame {expected} came within {self._options.timeout_s:g} s; "
            f"is the unit powered, terminated, and set to these identifiers and bit rate?"
            + (f" ({self._misfit})" if self._misfit else "")
        )

    def _raise_incomplete(self, series: Series) -> None:
        if unheard := [m for name, m in self._measuring.items() if name not in series.heard]:
            raise self._silent(unheard)
        label, readings = min(series.readings.items(), key=lambda item: len(item[1]))
        message, _ = self._channels[label]
        if series.repeated:
            why = f"{series.repeated} frames repeat their counter: it has stopped measuring; switch it off and on"
        else:
            why = self._misfit or "frames were lost: check bus load, termination and screen"
        raise BadReply(
            f"{self._where}: {len(readings)} of {series.count} readings of {label} came in {frame_name(message)}; {why}"
        )


def _command(database: Database, action: str, session: int, sweeps: int, period_s: float) -> tuple[int, bytes]:
    """Identifier and data of a command."""
    message = database.get_message_by_name("Command")
    period_ms = round(1000.0 * period_s)
    values: dict[str, int | str] = {"Action": action, "Session": session, "Sweeps": sweeps, "Period": period_ms}
    return message.frame_id, message.encode(values)
