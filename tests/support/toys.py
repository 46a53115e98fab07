"""What the tests of campaigns do with a seed, in workers of their own."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def square(seed: int) -> dict[str, object]:
    return {"square": seed * seed, "root": seed**0.5, "worker": None}


def dies_once(seed: int, folder: Path) -> dict[str, object]:
    """Seeds that three divides kill the process that first gets them."""
    mark = folder / str(seed)
    if seed % 3 == 0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(seed)


def dies(seed: int) -> dict[str, object]:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def fails(seed: int) -> dict[str, object]:
    raise ZeroDivisionError(f"seed {seed}")


def counted(seed: int, folder: Path) -> dict[str, object]:
    """Leaves a mark for every time that it was done, with its process; takes a moment."""
    (folder / f"{seed}-{os.getpid()}").touch()
    time.sleep(0.05)  # noqa: TID251 - a campaign in real time, to be killed
    return square(seed)


def alone(seed: int, folder: Path) -> dict[str, object]:
    """Who else is at it in this process."""
    mark = folder / f"{os.getpid()}-{seed}"
    mark.touch()
    time.sleep(0.05)  # noqa: TID251 - as above
    others = [path.name for path in folder.glob(f"{os.getpid()}-*") if path != mark]
    mark.unlink()
    return {"others": others, "process": os.getpid()}


def times(seed: int, factor: int) -> dict[str, object]:
    return {"value": factor * seed}
