"""A voltmeter and a source on scpipy's own server: parser, error queue and status registers are not of this project.

`python foreign_scpi.py` serves one instrument that is both, on one port, and prints the port.
"""

from __future__ import annotations

import asyncio
import socket
import sys

from scpipy.server import Context, Router, Server
from scpipy.shared.errors import DefaultScpiErrors, ScpiException

IDENTITY = "STRANGER INC.,SMU 1,S123,2.1"
router = Router()


def number(text: str, low: float, high: float) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ScpiException(DefaultScpiErrors.DATA_TYPE_ERROR.value) from None
    if not low <= value <= high:
        raise ScpiException(DefaultScpiErrors.DATA_OUT_OF_RANGE.value)
    return value


@router.register("*IDN?")
def identity(context: Context) -> str:
    return IDENTITY


@router.register("*RST")
def reset(context: Context) -> None:
    context.state.update(volts=0.0, range=1000.0, count=1, on=0)


@router.register("*PSC <value>")
def power_on_clear(context: Context, value: str) -> None:
    number(value, 0, 1)


@router.register("SOURce:VOLTage[:LEVel] <value>")
def set_volts(context: Context, value: str) -> None:
    context.state["volts"] = number(value, -20.0, 20.0)


@router.register("SOURce:VOLTage[:LEVel]?")
def volts(context: Context) -> str:
    return f"{context.state.get('volts', 0.0):.6E}"


@router.register("OUTPut[:STATe] <value>")
def switch(context: Context, value: str) -> None:
    context.state["on"] = {"ON": 1, "1": 1, "OFF": 0, "0": 0}[value.upper()]


@router.register("OUTPut[:STATe]?")
def output(context: Context) -> int:
    return context.state.get("on", 0)


@router.register("SENSe:VOLTage:RANGe <value>")
def set_range(context: Context, value: str) -> None:
    context.state["range"] = number(value, 0.1, 1000.0)


@router.register("SENSe:VOLTage:RANGe?")
def its_range(context: Context) -> str:
    return f"{context.state.get('range', 1000.0):.4E}"


@router.register("SAMPle:COUNt <value>")
def set_count(context: Context, value: str) -> None:
    context.state["count"] = int(number(value, 1, 100))


@router.register("INITiate")
def initiate(context: Context) -> None:
    context.state["readings"] = [reading(context)] * context.state.get("count", 1)


@router.register("FETCh?")
def fetch(context: Context) -> str:
    return ",".join(f"{value:+.8E}" for value in context.state["readings"])


@router.register("READ?")
async def read(context: Context) -> str:
    await asyncio.sleep(0.02)  # noqa: TID251 - in a process of its own
    return f"{reading(context):+.8E}"


def reading(context: Context) -> float:
    return context.state.get("volts", 0.0) * context.state.get("on", 0)


if __name__ == "__main__":
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    server = Server("127.0.0.1", port, shared_context=True)
    server.include_router(router)
    print(port, flush=True)
    sys.exit(server.run())
