"""Damaged and edited calibration files: exit code 2, with the file, the key and what to do; never a traceback."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command import rig

from rig.errors import UsageError
from rig.verbs.infer import calibration_in
from rig.verbs.infer.content_hash import KEY, NOT_CHECKED

TABLE = "x,y\n" + "".join(f"{i},{2 + 3 * i + 0.1 * (i * 7 % 5 - 2):.3f}\n" for i in range(14))
READINGS = "y\n5\n20\n"
WHY = ("damaged.json", "r.csv: there is no column", "this calibration of y cannot be inverted")
"""Where numbers still fit together, the reason is that of a calibration with such numbers."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("changed")
    (made / "t.csv").write_text(TABLE)
    (made / "r.csv").write_text(READINGS)
    assert rig("fit", "t.csv", "--response", "y", "--formula", "1 + x", "--out", "c.json", cwd=made).returncode == 0
    return made


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Keys and indices of every value inside."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, part in parts:
        yield (*at, name)
        yield from places(part, (*at, name))


def value_at(value: Any, at: tuple[Any, ...]) -> Any:
    for part in at:
        value = value[part]
    return value


def damages(value: Any) -> list[Any]:
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int | float):
        return [value * 2 + 1, -1.5, 1e308, None, "x", [1]]
    if isinstance(value, str):
        return [value + "x", 5]
    if isinstance(value, list):
        return [value[:-1], value + value, [value], {}, None] if value else [[1]]
    return [{}, [], None] if value else [{"a": 1}]


def damaged(content: dict[str, Any]) -> Iterator[tuple[tuple[Any, ...], dict[str, Any]]]:
    """Every value deleted, changed, cut, doubled and of another shape."""
    for at in places(content):
        for value in [None, *damages(value_at(content, at))]:
            made = copy.deepcopy(content)
            parent = value_at(made, at[:-1])
            if value is None:
                del parent[at[-1]]
            else:
                parent[at[-1]] = value
            yield at, made


def test_any_change_of_the_file_is_named_with_its_key(folder):
    content = json.loads((folder / "c.json").read_text())
    assert calibration_in(json.dumps(content), "c.json").notes == ()
    count = 0
    for at, made in damaged({name: value for name, value in content.items() if name != KEY}):
        made[KEY] = content[KEY]
        with pytest.raises(UsageError) as refused:
            calibration_in(json.dumps(made), "c.json")
        assert str(refused.value).startswith(
            "c.json is not a calibration file of `rig fit --out`, or was changed since: "
        )
        assert str(at[0]) in str(refused.value)
        count += 1
    assert count > 300


def test_the_block_for_readers_cannot_differ_from_that_which_is_used(folder):
    content = json.loads((folder / "c.json").read_text())
    content["coefficients"]["x"]["estimate"] = 7.0
    (folder / "edited.json").write_text(json.dumps(content))
    done = rig("infer", "edited.json", "r.csv", "--out", "o.csv", cwd=folder)
    assert done.returncode == 2
    assert (
        "edited.json is not a calibration file of `rig fit --out`, or was changed since: "
        "coefficients is not what sha256 in it says" in done.stderr
    )
    assert "rig fit DATA --out edited.json" in done.stderr


def test_a_file_without_a_hash_says_that_it_is_not_checked(folder):
    content = json.loads((folder / "c.json").read_text())
    del content[KEY]
    (folder / "old.json").write_text(json.dumps(content))
    done = rig("infer", "old.json", "r.csv", "--out", "o.csv", cwd=folder)
    assert done.returncode == 0
    assert NOT_CHECKED in done.stderr + done.stdout


def test_a_damaged_file_without_a_hash_is_used_or_refused_and_never_a_fault(folder):
    content = json.loads((folder / "c.json").read_text())
    used = {name: content[name] for name in ("data", "calibration")}
    refused = 0
    for at, made in damaged(used):
        (folder / "damaged.json").write_text(json.dumps(made))
        done = rig("infer", "damaged.json", "r.csv", "--out", "o.csv", cwd=folder)
        assert done.returncode in (0, 2), (at, done.stderr)
        if done.returncode == 2:
            assert any(words in done.stderr for words in WHY), (at, done.stderr)
            refused += 1
    assert refused > 100
