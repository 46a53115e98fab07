"""Declared instruments behind one line: a GPIB adapter that has to be told whom it talks to, and one that streams."""

from __future__ import annotations

import socketserver
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from fake_lines import answering

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.drivers.clock import RealClock
from rig.drivers.declared import driver_of
from rig.drivers.wires import Wires
from rig.errors import ConfigurationError
from rig.instruments.opening import identities, open_bench

METER = """
maker = "HP"
model = "HP3478A"
parameters = { node = 9 }
[wire]
preamble = ["++addr {node}"]
[identity]
ask = "ID?"
answer = "{model}"
[reader]
unit = "V"
reading = { ask = "N5T3", answer = "{value:+.5e}" }
"""
SOURCE = """
maker = "FLUKE"
model = "5500A"
parameters = { node = 4 }
[wire]
preamble = ["++addr {node}"]
[identity]
ask = "*IDN?"
[source]
unit = "V"
low = -10
high = 10
set = "OUT {value:.5}"
setpoint = "OUT?"
safe_value = 0
dwell_s = 0
"""
STREAMING = """
maker = "Vaisala"
model = "HMT330"
[wire]
preamble = ["S"]
[identity]
ask = "?"
answer = "{model} / {firmware}"
[reader]
unit = "pct"
reading = { ask = "SEND", answer = "RH= {value:.1} %RH" }
"""


class Line:
    """One port on which lines are answered; what they were is in `heard`."""

    def __init__(self, answer: Callable[[str], str | None], talk: Callable[[], str] | None = None) -> None:
        self.heard: list[str] = []
        outer = self

        class Lines(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                ended = threading.Event()
                if talk is not None:
                    threading.Thread(target=outer.talking, args=(self.wfile, ended, talk), daemon=True).start()
                for line in self.rfile:
                    outer.heard.append(line.decode().strip())
                    if said := answer(outer.heard[-1]):
                        self.wfile.write(f"{said}\n".encode())
                ended.set()

        self.served = ExitStack()
        self.address = f"socket://127.0.0.1:{self.served.enter_context(answering(Lines))}"

    @staticmethod
    def talking(out, ended: threading.Event, talk: Callable[[], str]) -> None:
        while not ended.wait(0.02):
            try:
                out.write(talk().encode())
            except OSError:
                return

    def close(self) -> None:
        self.served.close()


@pytest.fixture
def adapter() -> Iterator[Line]:
    """A Prologix adapter with two instruments."""
    state = {"addr": 0, "volts": 0.0}

    def answer(line: str) -> str | None:
        word, _, rest = line.partition(" ")
        if word == "++addr":
            state["addr"] = int(rest)
        elif state["addr"] == 9:
            return {"ID?": "HP3478A", "N5T3": f"{state['volts']:+.5E}"}.get(line)
        elif state["addr"] == 4:
            if word == "OUT":
                state["volts"] = float(rest)
            return {"*IDN?": "FLUKE,5500A,77,1.0", "OUT?": f"{state['volts']:.5f}"}.get(line)
        return None

    line = Line(answer)
    yield line
    line.close()


def test_two_instruments_share_an_address_and_each_is_addressed(adapter):
    text = f"""name = "shared"
[instruments.dvm]
driver = "dvm.toml"
address = "{adapter.address}"
[instruments.cal]
driver = "cal.toml"
address = "{adapter.address}"
[sensors.x]
reader = "dvm"
[factors]
level_V = "cal"
"""
    config = parse_bench(text, "bench.toml")
    with pytest.raises(ConfigurationError, match="is read beside the bench file"):
        check_options(config, "bench.toml")
    files = {"dvm": METER, "cal": SOURCE}
    instruments = {name: one.model_copy(update={"driver": files[name]}) for name, one in config.instruments.items()}
    config = config.model_copy(update={"instruments": instruments})
    clock = RealClock()
    bench = open_bench(config, check_options(config, "bench.toml"), clock, Wires(clock))
    assert {name: one["model"] for name, one in identities(bench).items()} == {"dvm": "HP3478A", "cal": "5500A"}
    for instrument in bench.instruments.values():
        instrument.prepare()
    bench.instruments["cal"].set(2.5)
    bench.instruments["dvm"].start(2)
    assert bench.instruments["dvm"].fetch() == {"input": [2.5, 2.5]}
    assert adapter.heard[-6:] == ["++addr 4", "OUT 2.50000", "OUT?", "++addr 9", "N5T3", "N5T3"]
    bench.close()


def test_a_stream_is_stopped_before_anything_is_asked():
    state = {"runs": True}

    def answer(line: str) -> str | None:
        if line == "S":
            state["runs"] = False
        return {"?": "HMT330 / 5.16", "SEND": "RH= 40.5 %RH"}.get(line) if not state["runs"] else None

    line = Line(answer, lambda: "RH= 39.9 %RH\n" if state["runs"] else "")
    clock = RealClock()
    wires = Wires(clock)
    driver = driver_of(STREAMING)
    it = driver("probe", line.address, driver.Options(), wires, clock)
    try:
        assert it.identify().firmware == "5.16"
        it.prepare()
        it.start(1)
        assert it.fetch() == {"input": [40.5]}
        state["runs"] = True  # it was switched off and on
        it.prepare()
        it.start(1)
        assert it.fetch() == {"input": [40.5]}
        assert line.heard.count("S") == 3  # once to be identified, and whenever it is prepared
    finally:
        wires.close()
        line.close()
