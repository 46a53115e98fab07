"""`python -m rig` is `rig`."""

from __future__ import annotations

import signal


def main() -> None:
    """Entry point. An interrupt before the command is there ends the process without a word: nothing was begun.

    One after its end changes nothing: what it ended with is what whoever waits for it is told.
    """
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from rig.cli import main as command  # noqa: PLC0415

    signal.signal(signal.SIGINT, before)
    try:
        command()
    finally:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    main()
