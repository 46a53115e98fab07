"""An example laboratory with some of its sensors: their pictures are what takes time in a report."""

from __future__ import annotations

from pathlib import Path

from rig.bench.config import parse_toml
from rig.files.toml_text import toml_text


def with_sensors(lab: Path, folder: Path, *kept: str) -> tuple[Path, Path]:
    """Bench and world file, written into a folder."""
    bench, world = (parse_toml((lab / f"{name}.toml").read_text(), name) for name in ("bench", "world"))
    others = bench["sensors"].keys() - {*kept}
    for values in (bench["sensors"], world["sensors"], *sizes_by_sensor(world)):
        for name in others & values.keys():
            del values[name]
    paths = folder / "bench.toml", folder / "world.toml"
    for path, values in zip(paths, (bench, world), strict=True):
        path.write_text(toml_text(values))
    return paths


def sizes_by_sensor(world: dict) -> list[dict]:
    return [size for effect in world["effects"].values() for size in effect.values() if isinstance(size, dict)]
