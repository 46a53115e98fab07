"""cantools reads what the simulated data-acquisition unit sends, and makes the command that it obeys, by our DBC."""

from __future__ import annotations

from math import inf
from typing import Any

import cantools.database
import pytest
from buses import CONTRACTS

from rig.sims.twins.can_daq import CanDaqTwin
from rig.sims.world import World

DBC = (CONTRACTS / "can_daq.dbc").read_text(encoding="utf-8")
THEIRS = cantools.database.load_string(DBC, "dbc")
TRUE_DEGC = {"sensor_temperature": 23.456, "sse_temperature": -60.0}


class Inputs:
    """Two thermometers, an open third, and 1.5 V."""

    class truth:  # noqa: N801
        seed = 7

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:
        return TRUE_DEGC.get(channel, inf)

    def channel_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:
        return 1.5


class Unit:
    """The unit, commanded and heard by cantools alone."""

    def __init__(self) -> None:
        self.world = World()
        self.twin = CanDaqTwin("daq", {"dbc": DBC}, self.world, Inputs(), "SN004711")
        self.heard: list[tuple[str, dict[str, Any]]] = []

    def command(self, **values: object) -> None:
        frame = THEIRS.encode_message("Command", {"Session": 0, "Sweeps": 0, "Period": 10, **values})
        self.twin.on_frame(THEIRS.get_message_by_name("Command").frame_id, frame, self._heard)
        self.world.sleep(1.0)

    def _heard(self, can_id: int, data: bytes) -> None:
        message = THEIRS.get_message_by_frame_id(can_id)
        assert len(data) == message.length
        self.heard.append((message.name, dict(message.decode(data))))


def test_it_identifies_itself() -> None:
    unit = Unit()
    unit.command(Action="Identify")
    [(name, said)] = unit.heard
    assert (name, said["SerialNumber"], said["Product"]) == ("Identity", 4711, "Four-input unit")


def test_its_readings_are_the_inputs_and_an_open_input_is_told() -> None:
    unit = Unit()
    unit.command(Action="Acquire", Session=9, Sweeps=3, Period=20)
    readings = [said for name, said in unit.heard if name == "Readings"]
    statuses = [said for name, said in unit.heard if name == "Status"]
    assert [said["Sweep"] for said in readings] == [1, 1, 2, 2, 3, 3]
    assert [said["Session"] for said in readings] == [9] * 6
    for said in readings[::2]:
        assert said["SensorTemperature"] == pytest.approx(23.456, abs=0.01)
        assert said["SseTemperature"] == pytest.approx(-60.0, abs=0.01)
    assert all(said["SpareVoltage"] == pytest.approx(1.5, abs=1e-4) for said in readings[1::2])
    assert [said["Sweep"] for said in statuses] == [1, 2, 3]
    for said in statuses:
        assert said["SpareTemperatureFault"] == "open circuit"
        assert {str(said[f"{name}Fault"]) for name in ("SensorTemperature", "SseTemperature", "SpareVoltage")} == {
            "none"
        }


def test_it_stops_when_told_to() -> None:
    unit = Unit()
    unit.command(Action="Acquire", Session=1, Sweeps=60000, Period=100)
    unit.command(Action="Stop", Session=2)
    count = len(unit.heard)
    assert unit.heard[-1][0] == "Status"
    assert unit.heard[-1][1]["Session"] == 2
    unit.world.sleep(10.0)
    assert len(unit.heard) == count
