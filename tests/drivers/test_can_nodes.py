"""Simulated CAN nodes: SDO server and EDS against canopen's, the serial adapter against its protocol."""

from pathlib import Path

import pytest
from canopen import LocalNode, Network
from canopen.objectdictionary import ODVariable

from rig.drivers.wires.can_node import read_eds as canopens_eds
from rig.sims.wires.eds import Key, identified, read_eds
from rig.sims.wires.sdo_server import NO_OBJECT, NO_SUBINDEX, READ_ONLY, TOO_LONG, Aborted, SdoServer
from rig.sims.wires.slcan import SlcanAdapter

EDS = (Path(__file__).parents[2] / "contracts" / "cia402_drive.eds").read_text(encoding="utf-8")


class Dictionary:
    """The data sheet's defaults as a node's objects."""

    def __init__(self) -> None:
        self.objects = read_eds(EDS, 1)
        self.values: dict[Key, bytes] = {key: o.pack(o.default) for key, o in self.objects.items()}

    def read(self, index: int, subindex: int) -> bytes:
        self._check(index, subindex)
        return self.values[index, subindex]

    def write(self, index: int, subindex: int, data: bytes) -> None:
        self._check(index, subindex)
        if self.objects[index, subindex].access != "rw":
            raise Aborted(READ_ONLY)
        self.values[index, subindex] = data

    def _check(self, index: int, subindex: int) -> None:
        if (index, subindex) not in self.objects:
            raise Aborted(NO_SUBINDEX if any(i == index for i, _ in self.objects) else NO_OBJECT)


def test_every_object_is_read_from_the_data_sheet_as_canopen_reads_it() -> None:
    for node in (1, 42):
        theirs: dict[Key, ODVariable] = {}
        dictionary = canopens_eds(EDS, node)
        for entry in dictionary.values():
            variables = [entry] if isinstance(entry, ODVariable) else entry.values()
            theirs |= {(v.index, v.subindex): v for v in variables}
        ours = read_eds(EDS, node)
        assert set(ours) == set(theirs)
        for key, found in ours.items():
            other = theirs[key]
            assert (found.name, found.data_type, found.access) == (other.name, other.data_type, other.access_type), key
            assert (found.low, found.high) == (other.min, other.max), key
            assert found.default == (other.default or type(found.default)()), key
            if found.size is not None:
                assert found.size == len(other) // 8
                assert found.unpack(other.encode_raw(3)) == 3


REQUESTS = {
    "a number of four bytes": "4000100000000000",
    "a number of two bytes": "4065600000000000",
    "a number of one byte": "4060600000000000",
    "a member of a record": "4018100200000000",
    "how many members": "4018100000000000",
    "an object that is not there": "4000200000000000",
    "write two bytes": "2b40600006000000",
    "read them back": "4040600000000000",
    "write four bytes": "237a6000d2040000",
    "write one byte": "2f60600001000000",
    "write what is read only": "2b41600000000000",
    "a text": "4008100000000000",
    "its first segment": "6000000000000000",
    "its second segment": "7000000000000000",
    "its last segment": "6000000000000000",
    "another text": "4008100000000000",
    "a segment that does not toggle": "7000000000000000",
    "no such command": "e000000000000000",
}


def test_answers_are_those_of_canopen_byte_for_byte() -> None:
    network, sent = Network(), []
    network.send_message = lambda can_id, data, remote=False: sent.append(bytes(data))  # type: ignore[method-assign]  # canopen's documented hook
    node: LocalNode = network.create_node(1, canopens_eds(EDS, 1))
    server = SdoServer(Dictionary())
    for what, text in REQUESTS.items():
        request = bytes.fromhex(text)
        network.notify(0x601, bytearray(request), 0.0)
        ours = server.answer(request)
        assert ours is not None
        theirs = sent.pop()
        if what in (
            "a segment that does not toggle",
            "no such command",
        ):  # refused, and there is no object to name in the answer
            assert (ours[0], ours[4:]) == (0x80, theirs[4:]), what
        else:
            assert ours == theirs, what
    assert node.sdo[0x607A].raw == 1234


def test_an_abort_ends_a_transfer_without_an_answer() -> None:
    server = SdoServer(Dictionary())
    server.answer(bytes.fromhex("4008100000000000"))
    assert server.answer(bytes.fromhex("8008100000000405")) is None
    assert server.answer(bytes.fromhex("6000000000000000")) == bytes.fromhex("8000000001000405")


def test_segmented_downloads_are_refused() -> None:
    answer = SdoServer(Dictionary()).answer(bytes.fromhex("217a600004000000"))
    assert answer == bytes.fromhex("807a600001000405")


def test_an_abort_code_travels_low_byte_first() -> None:
    class Full(Dictionary):
        def write(self, index: int, subindex: int, data: bytes) -> None:
            raise Aborted(TOO_LONG)

    assert SdoServer(Full()).answer(bytes.fromhex("237a600000000000")) == bytes.fromhex("807a600012000706")


class Bus:
    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes]] = []
        self.out = b""
        self.adapter = SlcanAdapter(self._on_frame)
        self.answer: tuple[int, bytes] | None = None

    def _on_frame(self, can_id: int, data: bytes, tx: object) -> None:
        self.frames.append((can_id, data))
        if self.answer and callable(tx):
            tx(*self.answer)

    def say(self, text: bytes) -> bytes:
        self.out = b""
        self.adapter.on_rx(text, self._hear)
        return self.out

    def _hear(self, data: bytes) -> None:
        self.out += data


@pytest.mark.parametrize(
    ("before", "command", "answer"),
    [
        (b"", b"S6\r", b"\r"),
        (b"", b"O\r", b"\r"),
        (b"O\r", b"O\r", b"\a"),
        (b"O\r", b"S6\r", b"\a"),
        (b"O\r", b"C\r", b"\r"),
        (b"", b"t6010\r", b"\a"),
        (b"L\r", b"t6010\r", b"\a"),
        (b"O\r", b"t60124018\r", b"z\r"),
        (b"O\r", b"T0000060124018\r", b"Z\r"),
        (b"O\r", b"r6018\r", b"z\r"),
        (b"O\r", b"t60134018\r", b"\a"),
        (b"O\r", b"t8010\r", b"\a"),
        (b"O\r", b"tXYZ0\r", b"\a"),
        (b"O\r", b"t601940181004000000\r", b"\a"),
        (b"", b"V\r", b"V1013\r"),
        (b"", b"?\r", b"\a"),
        (b"", b"\r\r", b""),
    ],
)  # fmt: skip
def test_the_adapters_commands(before: bytes, command: bytes, answer: bytes) -> None:
    bus = Bus()
    bus.say(before)
    assert bus.say(command) == answer


def test_frames_cross_the_adapter_both_ways_while_it_is_open() -> None:
    bus = Bus()
    bus.answer = (0x581, bytes.fromhex("4b41600037020000"))
    bus.say(b"O\r")
    assert bus.say(b"t6018404160") == b""
    assert bus.say(b"0000000000\r") == b"t58184B41600037020000\rz\r"
    assert bus.frames == [(0x601, bytes.fromhex("4041600000000000"))]


def test_a_long_line_of_noise_is_refused_and_forgotten() -> None:
    bus = Bus()
    bus.say(b"O\r")
    assert bus.say(b"t" + b"0" * 5000 + b"\r") == b"\a"
    assert bus.say(b"t6010\r") == b"z\r"


def test_a_drive_knows_its_maker_where_its_data_sheet_gives_no_defaults() -> None:
    bare = EDS.replace("DefaultValue=0x00020192", "DefaultValue=").replace(
        "VendorNumber=0x00000000", "VendorNumber=0x9A"
    )
    lines = [line for line in bare.splitlines() if line != "DefaultValue=0x00000402"]
    text = "\n".join(lines)
    found = identified(read_eds(text, 1), text)
    assert [found[key].default for key in ((0x1000, 0), (0x1018, 1), (0x1018, 2))] == [0x00020192, 0x9A, 0x402]
