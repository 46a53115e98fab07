"""What holds for everything that an instrument's file sends: its wire, its identity, its errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, field_validator

from rig.contracts.declared.exchanges import Ask, Strict, Texts
from rig.contracts.declared.sums import Checksum, Replies
from rig.contracts.declared.sums import Frame as FrameOfLine

Frame = Literal["7E1", "7E2", "7O1", "7O2", "8N1", "8N2", "8E1", "8O1"]
Number = Literal["int16", "uint16", "int32", "uint32", "float32"]


class Wire(Strict):
    """How it is connected, and what holds for every line."""

    protocol: Literal["text", "modbus", "stream", "can"] = Field(
        "text",
        description="text: lines with an answer; modbus: registers; stream: it talks by itself; can: messages of a DBC",
    )
    baud: int = Field(9600, ge=300, le=921600, description="symbols per second of a serial line")
    frame: Frame = Field("8N1", description="data bits, parity, stop bits")
    flow: Literal["none", "rtscts", "xonxoff", "dsrdtr"] = Field("none", description="flow control of a serial line")
    send_end: str = Field(
        "\n",
        max_length=4,
        description='end of a line that is sent; "": frames end by themselves, as request and reply say',
    )
    reply_end: str = Field("", max_length=4, description="end of an answer; left out: as send_end, or its frame's")
    encoding: Literal["latin-1", "utf-8"] | None = Field(
        None, description="of characters beyond ASCII; left out: one byte each, Latin-1, if the file has any"
    )
    shared: bool = Field(
        False, description="another instrument, or another quantity of this one in a file of its own, has its address"
    )
    timeout_s: float = Field(2.0, ge=0.05, le=60, description="longest wait for an answer")
    pace_s: float = Field(0.0, ge=0, le=10, description="shortest time from one line to the next")
    clear: str = Field(
        "",
        max_length=4,
        description="characters by which it gives up what it does and empties its buffers (device clear): sent before "
        "identity and preparing, and to make a reader safe; GPIB, USB and HiSLIP have their own",
    )
    clear_drops_dtr: bool = Field(False, description="whether the line DTR has to be dropped for it")
    remote: str = Field(
        "",
        description="command for remote control over a serial line, sent before identity and preparing; its panel is "
        'then locked, and `check` is asked after preparing only; never sent with interface = "gpib" in the bench file',
    )
    done: Ask | None = Field(
        None, description="question that it answers once a command that prepares it has been carried out: `*OPC?`"
    )
    headers: Texts | None = Field(
        None,
        description="an answer may repeat the header of its question, `:SOUR:PRES 5`, and no other; ends of headers "
        "that it may spell out, or []",
    )
    echo: bool = Field(False, description="it sends every line back before its answer")
    preamble: tuple[str, ...] = Field(
        (), description="lines before all others, and whenever another instrument has used the wire: `++addr 9`"
    )
    read: str = Field(
        "",
        description="line after a question by which an adapter fetches the answer, and each of its lines: `++read eoi`",
    )
    request: str = Field(
        "{line}", description="a whole line that is sent: {line}, parameters, {checksum}, or {checksum:03}"
    )
    reply: Texts = Field(
        ("{line}",),
        description="a whole answer; parameters in it have to be right, so has {checksum}; several: the one that fits, "
        "one without {line} is an answer by itself",
    )
    checksum: Checksum | None = Field(
        None,
        description="of all characters before it, in hexadecimal digits: sum, negative sum, xor, crc8, crc8 maxim, "
        "crc16 modbus, crc16 arc, crc16 ccitt, crc16 xmodem, crc32; a table says more: see there",
    )
    type: Number = Field("int16", description="type of most registers")
    word_order: Literal["big", "little"] = Field("big", description="which word of two is first: the high one is big")
    first_register: int = Field(0, ge=0, le=1, description="number that the manual gives to register 0 of the protocol")
    period_s: float = Field(
        1.0,
        gt=0,
        le=3600,
        description="stream: time from one line to the next; can: the same of messages without GenMsgCycleTime",
    )
    skip: Texts = Field((), description="stream: forms of its other lines, which are passed over, such as `# {}`")
    dbc: str = Field("", description="can: its DBC, a file beside this one; its text when the file has been read")
    cyclic: dict[str, Annotated[float, Field(ge=0.005, le=60)]] = Field(
        {}, description="can: messages that it wants again and again, with the seconds from one to the next"
    )
    identifiers_plus: str = Field(
        "", description="can: parameter that is added to the identifiers of the DBC, such as a node number"
    )
    counter: str = Field(
        "", description="can: signal that counts messages; one that repeats its number is of a hanging instrument"
    )

    @field_validator("checksum", mode="before")
    @classmethod
    def _none(cls, given: object) -> object:
        """Files of before checksums were tables had an empty text for none."""
        return None if given == "" else given

    @property
    def by_frame(self) -> bool:
        """Whether only the frame tells where an answer ends: it has no end, or bytes that may look like one."""
        return not self.send_end or (self.checksum is not None and self.checksum.binary)

    def with_reads(self, line: str, lines: int) -> str:
        """A question with the lines that fetch its answer of so many lines, without the last end."""
        return self.send_end.join((line, *[self.read] * lines)) if self.read else line

    def frames(self, known: Mapping[str, str | float]) -> tuple[FrameOfLine, Replies] | None:
        """Frames of what is sent and of answers; None if lines have none. Raises `ValueError`."""
        if self.request == "{line}" and self.reply == ("{line}",):
            return None
        return self.framed(self.request, known), Replies(self.reply, self.checksum, known)

    def framed(self, template: str, known: Mapping[str, str | float]) -> FrameOfLine:
        """The frame of one line. Raises `ValueError`."""
        return FrameOfLine(template, self.checksum, known)


class Identity(Ask):
    """Who it is. {maker} and {model} in its answer have to be the declared ones; {serial} and {firmware} are kept."""

    is_: float | str | None = Field(None, alias="is", description="of a register or signal: its right number or word")
    serial: str | None = Field(None, description="can: signal with its serial number")

    @property
    def forms(self) -> tuple[str, ...]:
        """Forms of its answer."""
        return self.answer or ("{maker},{model},{serial},{firmware}",)


class Errors(Strict):
    """How it says that it refuses. Without this table it never does."""

    ask: str | None = Field(None, description="question for an error, asked after every command")
    answer: Texts = Field(("{code},{text}",), description="forms of its answer: {code} and {text}")
    none: str = Field("0", description="the {code} without an error")
    each: bool = Field(
        True,
        description="it is asked after every command and every fetch; false: once after preparing, and where readings "
        "are missing",
    )
    queue: bool = Field(True, description="it is asked again until there is no error")
    bits: dict[str, str] = Field({}, description="errors by number of their bit in {code}, which is then a mask")
    replies: Texts = Field((), description="forms of answers to anything that mean an error: `ES`, `E{code}`")
    codes: dict[str, str] = Field({}, description="meaning of each {code}")
