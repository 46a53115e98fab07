"""The page of an item: the drift of its results in the picture of `rig chart`, with the day on which it is due."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from unittest.mock import patch
from urllib.parse import quote

import pytest
from lab_people import QUICK, WORD, with_people
from test_server import Server, logged_in

from rig.archive import Lab, due
from rig.archive.store import NAME
from rig.lab import people
from rig.serve.drift import for_page
from rig.verbs.chart import page
from tests.archive.test_archive import write

KEY = "EXAMPLE 10 kN S-1"


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    with patch.object(people, "COST", QUICK):
        yield


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = with_people(tmp_path / "lab")
    (folder / "certificates").mkdir()
    for year in range(2021, 2026):
        write(folder / "certificates", f"C-{year}", date(year, 1, 1), value=5.02 + 0.01 * (year - 2025))
    return folder


def test_the_page_has_the_picture_of_rig_chart_and_the_day_by_drift(lab: Path, monkeypatch: pytest.MonkeyPatch):
    drawn: list[object] = []
    own = page.draw_history
    monkeypatch.setattr(page, "draw_history", lambda *given: (drawn.append(given[2]), own(*given))[1])
    vera = logged_in(Server(lab), "vera")
    assert f'href="/item/{quote(KEY)}"' in vera.gets("/equipment").text
    shown = vera.gets(f"/item/{quote(KEY)}")
    with Lab.open(lab) as index:
        (found,) = [one for one in due(index) if one.key == KEY]
    assert (shown.status, len(drawn)) == (200, 1)
    assert found.drift.on in shown.text
    assert shown.text.count("<svg") == 1
    assert "style=" not in shown.text  # which the page's policy would refuse
    assert "currentColor" in shown.text
    assert [f"C-{year}" in shown.text for year in range(2021, 2026)] == [True] * 5


def test_where_the_index_cannot_be_kept_the_page_says_so(lab: Path):
    """Otherwise nothing would seem to be due."""
    (lab / NAME).write_bytes(b"no database, but long enough to look like one" * 50)
    vera = logged_in(Server(lab), "vera")
    assert "the index cannot be used" in vera.gets("/equipment").text
    assert vera.gets(f"/item/{quote(KEY)}").status == 404


def test_programs_get_the_same_values(lab: Path):
    basic = "Basic " + b64encode(f"vera:{WORD['vera']}".encode()).decode()
    server = Server(lab)
    told = json.loads(server.ask(f"/api/items/{quote(KEY)}", headers={"authorization": basic}).text)
    assert [one["value"] for one in told["results"][0]["values"]] == ["4.98", "4.99", "5", "5.01", "5.02"]
    assert told["due"]
    assert server.ask("/api/items/nothing", headers={"authorization": basic}).status == 404


@pytest.mark.parametrize("key", ["nothing", "../people.toml", "%00", "a/b", "<script>"])
def test_other_addresses_have_no_item(key: str, lab: Path):
    answer = logged_in(Server(lab), "vera").gets(f"/item/{quote(key)}")
    assert (answer.status, "<script>" in answer.text) == (404, False)


def test_a_picture_for_a_page_has_no_style_and_names_what_it_shows():
    path = '<path style="fill: none; stroke: #000000"/>'
    svg = f'<?xml?><svg width="1"><style>*{{}}</style><metadata>x</metadata>{path}</svg>'
    found = for_page(svg, 'a "b" <c>')
    assert re.sub(r"\s+", " ", found) == (
        '<svg class="drift" role="img" aria-label="a &quot;b&quot; &lt;c>" width="1">'
        '<path fill="none" stroke="currentColor"/></svg>'
    )
