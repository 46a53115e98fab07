"""Flow control by characters: an instrument sends XOFF while its buffer is filling, and XON afterwards."""

from __future__ import annotations

from collections.abc import Callable

from rig.sims.twins.scpi import ScpiTwin

_XON, _XOFF = b"\x11", b"\x13"
_MUCH = 100  # characters in its buffer at which it sends XOFF [?]


class XonXoffTwin(ScpiTwin):
    """An instrument that uses XON and XOFF if `holds_up` is set."""

    holds_up = False

    def switch_on(self) -> None:
        """The host may send."""
        self._held = False
        super().switch_on()

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """XOFF asks the host to stop while much is waiting, XON to continue."""
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
