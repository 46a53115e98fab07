"""Commands of a simulated 34970A, and its own errors (Command Reference 34970A/34972A, version 2.00)."""

from __future__ import annotations

from rig.sims.twins.keysight_mainframe import MAINFRAME
from rig.sims.twins.keysight_memory import MEMORY
from rig.sims.twins.keysight_trigger import TRIGGERING
from rig.sims.twins.scpi import COMMON
from rig.sims.twins.scpi_syntax import Command, compiled

COMMANDS = compiled(
    (
        *COMMON,
        *TRIGGERING,
        *MAINFRAME,
        *MEMORY,
        Command("ABORt", set="abort"),
        Command("CONFigure:VOLTage[:DC]", set="configure_volts"),
        Command("CONFigure:TEMPerature", set="configure_temperature"),
        Command("CONFigure", query="ask_configuration"),
        Command("ROUTe:SCAN", set="set_scan", query="ask_scan"),
        Command("ROUTe:SCAN:SIZE", query="ask_scan_size"),
        Command("[SENSe:]VOLTage[:DC]:NPLC", set="set_nplc_volts", query="ask_nplc_volts"),
        Command("[SENSe:]VOLTage[:DC]:RANGe", set="set_range", query="ask_range"),
        Command("[SENSe:]TEMPerature:NPLC", set="set_nplc_temperature", query="ask_nplc_temperature"),
        Command("[SENSe:]ZERO:AUTO", set="set_autozero", query="ask_autozero"),
        Command("[SENSe:]TEMPerature:TRANsducer:TYPE", query="ask_transducer"),
        Command("[SENSe:]TEMPerature:TRANsducer:THERmistor:TYPE", query="ask_thermistor"),
        Command("[SENSe:]TEMPerature:TRANsducer:RTD:TYPE", query="ask_rtd"),
        Command("[SENSe:]TEMPerature:TRANsducer:FRTD:TYPE", query="ask_frtd"),
        Command("[SENSe:]TEMPerature:TRANsducer:RTD:RESistance[:REFerence]", query="ask_ohms"),
        Command("[SENSe:]TEMPerature:TRANsducer:FRTD:RESistance[:REFerence]", query="ask_ohms"),
        Command("UNIT:TEMPerature", set="set_unit", query="ask_unit"),
        Command("TRIGger:TIMer", set="set_timer", query="ask_timer"),
        Command("SYSTem:LFRequency", query="ask_line_frequency"),
        Command("MEASure:VOLTage[:DC]", query="measure_volts"),
        Command("MEASure:TEMPerature", query="measure_temperature"),
        Command("[SENSe:]FUNCtion", query="ask_function"),
        Command("ROUTe:CHANnel:DELay", set="set_delay", query="ask_delay"),
        Command("STATus:OPERation:CONDition", query="ask_operation", local=True),
        Command("DIAGnostic:RELay:CYCLes", query="ask_relay_cycles"),
    )
)

ERRORS = {
    111: "Channel list: slot number out of range",
    112: "Channel list: channel number out of range",
    113: "Channel list: empty scan list",
    251: "Unsupported temperature transducer type",
    261: "Not able to execute while scan initiated",
    305: "Not able to perform requested operation",
    306: "Part of a 4-wire pair",
    308: "Channel not able to perform requested operation",
    309: "Incorrectly formatted channel list",
    514: "Not allowed",
    550: "Not able to execute command in local mode",
}
