"""Every byte on every wire in dry runs of the examples, as recorded on 29 November 2026.

A driver, or the twin of an instrument, that is written in another way sends and answers the same. Where bytes change on
purpose: `python tests/sims/test_wires_of_examples.py` records them anew; say in the commit why they changed.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

import rig.simulated.dry_run
from rig.drivers.wires import Wires
from rig.engine.session import Signals
from rig.runs.controller import start_run
from rig.runs.plans import load_plan

RECORDED = Path(__file__).with_name("wires_of_examples.json")
EXAMPLES = Path(__file__).parents[2] / "examples"
POINTS = 30
"""After these, the run is stopped, so that parking is recorded, too."""


def recorded(lab: str) -> dict[str, list[Any]]:
    """Transfers, bytes and their SHA-256 by instrument, in a dry run of an example."""
    rows: dict[str, list[bytes]] = {}

    class Tapped(Wires):
        def __init__(self, clock: Any, **options: Any) -> None:
            super().__init__(clock, **{**options, "tap": tap})

    def tap(name: str, way: str, data: bytes) -> None:
        rows.setdefault(name, []).append(f"{way} ".encode() + bytes(data))

    folder, signals = EXAMPLES / lab, Signals()

    def on_progress(news: Any) -> None:
        if news.done >= POINTS:
            signals.interrupt = "SIGTERM"

    plan = load_plan(folder / "procedure.toml", folder / "bench.toml", dry=True, world=folder / "world.toml")
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as out:
        patch.setattr(rig.simulated.dry_run, "Wires", Tapped)
        start_run(plan, Path(out), announce=lambda _: None, on_progress=on_progress, signals=signals)
    digests = {name: hashlib.sha256(b"\n".join(every)).hexdigest() for name, every in rows.items()}
    return {name: [len(every), sum(map(len, every)), digests[name]] for name, every in rows.items()}


LABS = sorted(path.name for path in EXAMPLES.iterdir() if (path / "procedure.toml").exists())


@pytest.mark.parametrize("lab", LABS)
def test_the_bytes_on_every_wire_are_those_recorded(lab):
    assert recorded(lab) == json.loads(RECORDED.read_text())[lab]


if __name__ == "__main__":
    RECORDED.write_text(json.dumps({lab: recorded(lab) for lab in LABS}, indent=1) + "\n")
    sys.stdout.write(f"{RECORDED}\n")
