"""The package in `tests/outside`, installed into a folder of its own as pip does it, without a network."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import invalidate_caches
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import rig
from rig.examples import example
from rig.procedures.kinds import kinds

SOURCE = Path(__file__).parents[1] / "outside"
DRIVER = "acme-m7"
METER = """[instruments.scanner]
driver = "acme-m7"
address = "/dev/rig/acme"
asset = "DVM-0777"

"""


@cache
def _site() -> TemporaryDirectory[str]:
    """Where the package is installed, built from a copy of its source; once, since what is imported stays imported."""
    folder = TemporaryDirectory(prefix="rig-outside-")
    source, where = Path(folder.name) / "source", Path(folder.name) / "site"
    shutil.copytree(SOURCE, source)
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "--no-input")
    command = [*pip, "install", "--no-index", "--no-deps", "--no-build-isolation", "--target", where, source]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    atexit.register(folder.cleanup)
    return folder


def _taken_out() -> dict[str, ModuleType]:
    """The modules that commands are in, which from now on are not imported."""
    names = [name for name in sys.modules if f"{name}.".startswith(("rig.cli.", "proving.command_"))]
    return {name: sys.modules.pop(name) for name in names}


@contextmanager
def installed() -> Iterator[Path]:
    """The package, importable here and in processes started meanwhile.

    The commands are imported anew, as a process begun now would: options of kinds are made when a command is imported.
    """
    where = Path(_site().name) / "site"
    before = os.environ.get("PYTHONPATH")
    without = _taken_out()
    sys.path.append(str(where))
    os.environ["PYTHONPATH"] = str(where) if before is None else f"{before}{os.pathsep}{where}"
    invalidate_caches()
    kinds.cache_clear()
    try:
        yield where
    finally:
        kinds.cache_clear()
        _taken_out()
        sys.modules.update(without)
        if "rig.cli" in without:
            rig.cli = without["rig.cli"]  # type: ignore[assignment]
        sys.path.remove(str(where))
        os.environ.pop("PYTHONPATH")
        if before is not None:
            os.environ["PYTHONPATH"] = before


def bench_text() -> str:
    """The example's attitude bench with the outside meter in its scanner's place."""
    text = (example("attitude-lab") / "bench.toml").read_text(encoding="utf-8")
    text = re.sub(r"\[instruments\.scanner\]\n(?:[^\[\n].*\n|\n)*", METER, text)
    for channel, ours in (("101", "A"), ("102", "B"), ("103", "C"), ("104", "T")):
        text = text.replace(f'channel = "{channel}"', f'channel = "{ours}"')
    assert text.count('channel = "A"') == 1
    return text
