"""Flow control by characters: an instrument that sends XOFF while it has much to do, and XON when it goes on."""

from __future__ import annotations

from collections.abc import Callable

from sims.twins.scpi import ScpiTwin

_XON, _XOFF = b"\x11", b"\x13"
_MUCH = 100  # characters in its buffer at which it says stop [?]


class XonXoffTwin(ScpiTwin):
    """An instrument with `holds_up` set to whether it uses XON and XOFF."""

    holds_up = False

    def switch_on(self) -> None:
        """Nobody is held up."""
        self._held = False
        super().switch_on()

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """XOFF asks the host to stop while much is waiting, XON to go on."""
        much = self.waiting + len(data) > _MUCH
        super().on_rx(data, tx)
        if self.holds_up and much and not self._held:
            self._held = True
            tx(_XOFF)
        if not self.busy:
            self._release(tx)

    def _next_line(self, tx: Callable[[bytes], None]) -> None:
        super()._next_line(tx)
        self._release(tx)

    def _release(self, tx: Callable[[bytes], None]) -> None:
        if self._held and not self.waiting:
            self._held = False
            tx(_XON)
