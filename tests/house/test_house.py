"""Who may know what: nothing outside a kind's folder knows the kind, and what kinds share knows none of them."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KINDS = ("rig.procedures.attitude", "rig.procedures.pressure", "rig.procedures.general")
SHARED_ROOMS = ("", "plan", "tables", "evaluate", "present")
SHARED = sorted(
    path for room in SHARED_ROOMS for path in (ROOT / "procedures" / room).glob("*.py") if path.stem != "__init__"
)
WORDS = frozenset({"pitch", "roll", "psia", "mv", "bridge", "attitude", "transducer", "transducers", "sse"})
"""What kinds measure, and on what: each a part of a name between underscores, or a word of a text."""
NAMES = frozenset({"pitch-roll", "whole-plot", "general"})
"""Kinds, as procedures and results name them: texts of their own."""

_LIBRARY = "a bridge to the driver of another library is none of resistors"
_CONTROLLER = "the role of a pressure controller, and of the line it fills"
EXCEPTIONS: dict[str, tuple[set[str], str]] = {
    "verbs/plan/unit_doubts.py": ({"mv"}, "units that a misspelt one may be meant for"),
    "units/si.py": ({"psia"}, "units that convert to those of the SI"),
    "verbs/data/of_table.py": ({"general"}, "a table without a run file is one of any laboratory"),
    "new/files.py": ({"general", "psia"}, "first files are those of any laboratory; the role of a pressure controller"),
    "cli/demo.py": ({"attitude", "roll", "transducers"}, "the example laboratories, and what is in them"),
    "bench/config.py": ({"sse"}, "a bench file's units of outputs and places of thermometers"),
    "bench/bridges.py": ({"bridge"}, _LIBRARY),
    "bench/bench_file.py": ({"bridge"}, _LIBRARY),
    "simulated/stand_ins.py": ({"bridge"}, _LIBRARY),
    "verbs/instrument/catalogue.py": ({"bridge"}, _LIBRARY),
    "verbs/instrument/check.py": ({"bridge"}, _LIBRARY),
    "engine/axes.py": ({"psia"}, _CONTROLLER),
    "engine/safe_state.py": ({"psia"}, _CONTROLLER),
    "runs/forecast.py": ({"sse"}, "places of thermometers of a bench file"),
    "instruments/guarded.py": ({"psia"}, _CONTROLLER),
    "runs/matching.py": ({"psia"}, _CONTROLLER),
    "bench/protection.py": ({"psia"}, _CONTROLLER),
    "units/of_instruments.py": (
        {"pitch", "roll", "psia", "mv"},
        "what the roles of instruments set, and units of outputs",
    ),
    "units/differences.py": ({"psia"}, "units that convert"),
    "run_file/events/points.py": ({"whole-plot"}, "a status in run files, of runs with hard-to-change factors"),
    "run_file/verify/sense/instruments_of_run.py": (
        {"psia"},
        "units of scanners' outputs, and the role of a pressure controller",
    ),
    "unattended/systemd_unit.py": ({"psia"}, _CONTROLLER),
    "simulated/world_keys.py": ({"attitude", "transducers", "sse"}, "tables of the two benches that are simulated"),
}
"""Files of rig that have words of kinds, and why they may."""


def python_files(*folders: str) -> list[Path]:
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def kinds_in(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {name for name in imported(tree) if name.startswith(tuple(KINDS))}


def words_in(path: Path) -> set[str]:
    """Words of kinds in names, texts and comments; names of kinds that are a text by themselves."""
    text = path.read_text(encoding="utf-8")
    parts = {part.lower() for word in re.findall(r"[A-Za-z_]+", text) for part in word.split("_")}
    quoted = {a or b for a, b in re.findall(r'"([a-z-]+)"|\'([a-z-]+)\'', text)}
    return (parts & WORDS) | (quoted & NAMES)


def test_the_program_imports_no_kind():
    found = {str(path.relative_to(ROOT)): kinds for path in python_files("rig") if (kinds := kinds_in(path))}
    assert found == {}


@pytest.mark.parametrize("path", SHARED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_kinds_share_imports_none_of_them(path):
    assert kinds_in(path) == set()


def test_the_contract_of_imports_says_so_too():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (program,) = (one for one in contracts if one["name"] == "rig names no kind of calibration")
    assert program["source_modules"] == ["rig.*"]
    assert program["forbidden_modules"] == [*KINDS]


def test_words_of_kinds_stand_in_kinds_alone():
    found = {path.relative_to(ROOT / "rig").as_posix(): words_in(path) for path in python_files("rig")}
    allowed = {name: words for name, (words, _) in EXCEPTIONS.items()}
    assert {name: words for name, words in found.items() if words} == allowed, "an exception that is none any more goes"


def test_the_check_sees_words_of_kinds(tmp_path):
    path = tmp_path / "some.py"
    path.write_text(
        'from rig.procedures.attitude.kind import KIND\nx = y["pressure_psia"] if kind == "general" else 0\n'
    )
    assert kinds_in(path) == {"rig.procedures.attitude.kind", "rig.procedures.attitude.kind.KIND"}
    assert words_in(path) == {"attitude", "psia", "general"}
    path.write_text('"""A new draw of the whole-plot error, in general; scrolls and rollbacks are none."""\n')
    assert words_in(path) == set()
