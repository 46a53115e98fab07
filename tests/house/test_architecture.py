"""The floor plan is drawn from the imports as they are, and every file it names exists."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
PLAN = runpy.run_path(str(ROOT / "tools" / "floor_plan"))


def section(title: str) -> list[str]:
    """Rows of the table under a heading, without its head."""
    (found,) = re.findall(rf"^## {title}\n(.*?)(?=^## |\Z)", TEXT, re.DOTALL | re.MULTILINE)
    return [line for line in found.splitlines() if line.startswith("| ")][2:]


def test_rooms_are_drawn_and_none_imports_one_that_imports_it():
    known = PLAN["rooms"]()
    found = PLAN["arrows"](known)
    drawn = "\n".join(PLAN["picture"](found, known))  # an error for a circle
    assert "rig_serve --> rig_watch" in drawn
    assert PLAN["table"](found, known).count("\n") == len(known) + 2


def test_every_room_is_on_the_page():
    inner = {room for room in PLAN["rooms"]() if room.count(".") == 1}
    kinds = {"procedures.attitude", "procedures.pressure", "procedures.general"}
    assert {room for room in inner - kinds if f"`{room.replace('.', '/')}/`" not in TEXT} == set()


def test_a_circle_of_rooms_is_named_and_no_picture():
    with pytest.raises(ValueError, match=r"import one another: a, b$"):
        PLAN["fewest"]({("a", "b"), ("b", "a"), ("b", "c")})


def test_arrows_that_follow_from_others_are_left_out():
    assert PLAN["fewest"]({("a", "b"), ("b", "c"), ("a", "c")}) == {("a", "b"), ("b", "c")}


@pytest.mark.parametrize(("document", "least"), [("docs/explanation/architecture.md", 60), ("CONTRIBUTING.md", 8)])
def test_every_file_it_names_exists(document, least):
    text = (ROOT / document).read_text(encoding="utf-8")
    named = [name for name in re.findall(r"`([\w./-]+)`", text) if "/" in name and "KIND" not in name]
    theirs = [name for name in named if name.startswith(("my_", "../"))]
    assert len(named) - len(theirs) >= least
    assert [name for name in named if name not in theirs and not (ROOT / name).exists()] == []


@pytest.mark.parametrize(
    "title", ["The path of a reading, from wire to certificate", "The path of a fault, from driver to exit code"]
)
def test_every_step_of_a_way_says_where(title):
    rows = section(title)
    assert len(rows) > 10
    assert all(re.search(r"`[\w/]+\.py` \|$", row) for row in rows)


def test_twenty_tasks_have_a_file_each():
    rows = section("Where to change what")
    assert len(rows) >= 20
    assert all(re.search(r"`[\w./]+\.(py|j2)`", row) for row in rows)
