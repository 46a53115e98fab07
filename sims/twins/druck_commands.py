"""Commands of a simulated Druck PACE, from the SCPI manual K0472, and the methods that execute them."""

from __future__ import annotations

from functools import lru_cache

from rig.sims.twins.scpi import COMMON
from rig.sims.twins.scpi_syntax import Command, compiled

_COMMON = [row for row in COMMON if row.header in ("*IDN", "*CLS", "*ESE", "*ESR", "*SRE", "*STB")]
_PACE = (
    ("INSTrument:SN", "", "ask_serial"),
    ("OUTPut[:STATe]", "set_output", "ask_output"),
    ("OUTPut:ISOLation[:STATe]", "set_isolation", "ask_isolation"),
    ("OUTPut:MODE", "set_mode", "ask_mode"),
    ("SENSe[:PRESsure]", "", "ask_pressure"),
    ("SENSe[:PRESsure]:INLimits", "", "ask_in_limits"),
    ("SENSe[:PRESsure]:BARometer", "", "ask_barometer"),
    ("SENSe[:PRESsure]:RANGe", "set_range", "ask_range"),
    ("SENSe[:PRESsure]:SLEW", "", "ask_measured_slew"),
    ("SOURce[:PRESsure][:LEVel][:IMMediate][:AMPLitude]", "set_setpoint", "ask_setpoint"),
    ("SOURce[:PRESsure][:LEVel][:IMMediate][:AMPLitude]:VENT", "set_vent", "ask_vent"),
    ("SOURce[:PRESsure]:COMPensate1", "", "ask_supply"),
    ("SOURce[:PRESsure]:COMPensate2", "", "ask_vacuum"),
    ("SOURce[:PRESsure]:EFFort", "", "ask_effort"),
    ("SOURce[:PRESsure]:INLimits", "set_band", "ask_band"),
    ("SOURce[:PRESsure]:INLimits:TIME", "set_band_time", "ask_band_time"),
    ("SOURce[:PRESsure]:RANGe", "set_range", "ask_range"),
    ("SOURce[:PRESsure]:SLEW", "set_slew", "ask_slew"),
    ("SOURce[:PRESsure]:SLEW:MODE", "set_slew_mode", "ask_slew_mode"),
    ("SOURce[:PRESsure]:SLEW:OVERshoot", "set_overshoot", "ask_overshoot"),
    ("STATus:OPERation[:EVENt]", "", "ask_operation_events"),
    ("STATus:OPERation:ENABle", "set_operation_enable", "ask_operation_enable"),
    ("STATus:OPERation:PRESsure:ENABle", "set_pressure_enable", "ask_pressure_enable"),
    ("STATus:OPERation:PRESsure[:EVENt]", "", "ask_pressure_events"),
    ("STATus:OPERation:PRESsure:CONDition", "", "ask_pressure_condition"),
    ("SYSTem:ERRor", "", "ask_error"),
    ("SYSTem:VERSion", "", "ask_version"),
    ("UNIT[:PRESsure]", "set_unit", "ask_unit"),
)
COMMANDS = {**compiled(_COMMON), **compiled([Command(header, set=s, query=q, local=True) for header, s, q in _PACE])}
"""Methods by header."""


@lru_cache(maxsize=256)
def echo(header: str) -> str:
    """A header in short form with every optional node spelt out, as at the begin of answers."""
    short = "".join(c for c in header if not (c.islower() or c in "[]"))
    return short if short.startswith("*") else f":{short}"
