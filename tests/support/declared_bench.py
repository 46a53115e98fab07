"""A declared instrument, from the text of its file, on a simulated bench with its twin."""

from __future__ import annotations

from typing import Any

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.instruments.opening import open_bench
from rig.simulated.dry_run import DryBench

ADDRESSES = {"text": "/dev/rig/it", "stream": "/dev/rig/it", "modbus": "modbus-tcp://192.0.2.9/1"}
ADDRESSES["can"] = "can:socketcan/can0"
QUIET = {"lab": {"daily_amplitude_degC": 0.0}}


class DeclaredBench:
    """The instrument `it`, and what goes over its wire.

    Attributes:
        it: its driver.
        twin: its twin.
        sent: lines sent, without their ends.
        wire: (direction, bytes) of every transfer.

    """

    def __init__(
        self, text: str, *, protocol: str = "text", more: str = "", world: dict[str, Any] | None = None
    ) -> None:
        self.wire: list[tuple[str, bytes]] = []
        source = "[source]" in text
        channels = "".join(
            f'[sensors.{name}]\nreader = "it"\nchannel = "{name}"\nunit = "{unit}"\n'
            for name, unit in self._channels(text).items()
        )
        other = '[instruments.dvm]\ndriver = "keysight-34401a"\naddress = "/dev/rig/dvm"\n[sensors.x]\nreader = "dvm"\n'
        more += '\nchannels = { "101" = "volts" }' * ("[scan]" in text and "channels" not in more)
        bench = f'name = "lab"\n[instruments.it]\ndriver = "it.toml"\naddress = "{ADDRESSES[protocol]}"\n{more}\n'
        bench += channels or other
        bench += f"[factors]\nlevel_{self._unit(text)} = 'it'\n" if source else ""
        config = parse_bench(bench, "bench.toml")
        instruments = dict(config.instruments)
        instruments["it"] = instruments["it"].model_copy(update={"driver": text})
        self.dry = DryBench(config.model_copy(update={"instruments": instruments}), world or QUIET, tap=self._tap)
        options = check_options(self.dry.config, "bench")
        self.bench = open_bench(self.dry.config, options, self.dry.world, self.dry.wires)
        self.it: Any = self.bench.instruments["it"]
        self.twin: Any = self.dry.sim.twin("it")
        self.sleep = self.dry.world.sleep

    @staticmethod
    def _channels(text: str) -> dict[str, str]:
        from rig.contracts.declared.instrument import parse  # noqa: PLC0415 - the text may be wrong on purpose

        reader = parse(text).chosen({}).reader
        if reader is None:
            return {}
        return {name: one.unit or reader.unit or "V" for name, one in reader.channels.items()} or {
            "input": reader.unit or "V"
        }

    @staticmethod
    def _unit(text: str) -> str:
        from rig.contracts.declared.instrument import parse  # noqa: PLC0415

        source = parse(text).source
        return (source and source.unit) or "V"

    def _tap(self, name: str, direction: str, data: bytes) -> None:
        if name == "it":
            self.wire.append((direction, data))

    @property
    def sent(self) -> list[str]:
        return [line for direction, data in self.wire if direction == "tx" for line in data.decode().splitlines()]

    def close(self) -> None:
        self.bench.close()
        self.dry.close()


def answers(it: DeclaredBench, **said: str) -> None:
    """The twin says this to lines that begin so."""
    before = it.twin._carried_out

    def carried_out(line: str) -> Any:
        found = next((text for begin, text in said.items() if line.startswith(begin)), None)
        return (found, 0.0) if found is not None else before(line)

    it.twin._carried_out = carried_out
