"""Self-description of the simulated 34970A: version of the standard, cards in its slots, multimeter.

Commands are from the 34970A/34972A Command Reference, version 2.00.
"""

from __future__ import annotations

from rig.sims.twins.keysight_channel import SLOTS
from rig.sims.twins.scpi_syntax import Command, ScpiError, number

MAINFRAME = (
    Command("SYSTem:CTYPe", query="ask_card", local=True),
    Command("DIAGnostic:DMM:CYCLes", query="ask_multimeter_cycles"),
    Command("DIAGnostic:PEEK:SLOT:DATA", query="ask_label"),
    Command("INSTrument:DMM", query="ask_multimeter"),
    Command("INSTrument:DMM:INSTalled", query="ask_multimeter"),
)


class Mainframe:
    """One 34901A in the first slot, two empty slots, and the internal multimeter."""

    def ask_version(self) -> str:
        """SYSTem:VERSion?."""
        return "1994.0"

    def ask_card(self, slot: str) -> str:
        """SYSTem:CTYPe?: card in a slot; zeros for an empty slot."""
        if number(slot) not in SLOTS:
            raise ScpiError(111)
        return f"HEWLETT-PACKARD,{'34901A,0,2.3' if number(slot) == SLOTS[0] else '0,0,0'}"

    def ask_multimeter_cycles(self) -> str:
        """DIAGnostic:DMM:CYCLes?: closures of the multimeter's relays; they are not counted."""
        return "+0,+0,+0"

    def ask_label(self, slot: str) -> str:
        """DIAGnostic:PEEK:SLOT:DATA?: user data of the card; none."""
        if number(slot) not in SLOTS:
            raise ScpiError(111)
        return '""'

    def ask_multimeter(self) -> str:
        """INSTrument:DMM?: the internal multimeter is present and switched on."""
        return "1"
