"""Entry point of `python -m rig` and `rig`."""

from __future__ import annotations

import signal


def main() -> None:
    """Entry point. An interrupt before the command starts ends the process silently: nothing was begun.

    An interrupt after its end changes nothing: the exit code is the command's.
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
