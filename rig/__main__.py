"""Entry point of `python -m rig` and `rig`."""

from __future__ import annotations

import gc
import os
import signal

_ONE_THREAD = "OPENBLAS_NUM_THREADS"
"""Read by the linear algebra of numpy and scipy when it is loaded. Our matrices are small: several threads mostly wait
for one another, six times as long on a busy machine. And rounding does not depend on the number of cores.
"""

_NO_PLUGINS = "PYDANTIC_DISABLE_PLUGINS"
"""Our models have none, and a search for them reads the lists of all installed packages, which takes 8 ms."""

_FEWER_COLLECTIONS = 20_000
"""Objects between two searches for cycles, Python's 700 by default: a command makes few cycles, and with 700 a tenth
of its start was spent on searches.
"""


def main() -> None:
    """Entry point. An interrupt before the command starts ends the process silently: nothing was begun.

    An interrupt after its end changes nothing: the exit code is the command's.
    """
    os.environ.setdefault(_ONE_THREAD, "1")
    os.environ.setdefault(_NO_PLUGINS, "__all__")
    gc.set_threshold(_FEWER_COLLECTIONS)
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
