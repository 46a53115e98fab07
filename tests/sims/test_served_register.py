"""`rig sim` writes its bench file where it is told to, and runs over it read the register of the bench."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from rig.examples import example
from rig.simulated import served


@pytest.mark.parametrize("elsewhere", [False, True])
def test_the_register_is_found_from_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, elsewhere: bool
) -> None:
    lab, other = tmp_path / "lab", tmp_path / "other"
    shutil.copytree(example("load-cell-lab"), lab)
    other.mkdir()
    told: list[dict[str, Any]] = []
    monkeypatch.setattr(served, "serve", lambda config, *_, **__: told.append(config))
    live = (other if elsewhere else lab) / "LIVE.toml"
    served.serve_bench(lab / "bench.toml", lab / "world.toml", 1.0, live, None, None, lambda _: None)
    written = Path(told[0].get("equipment") or "equipment.toml")
    assert (live.parent / written).resolve() == lab / "equipment.toml"
