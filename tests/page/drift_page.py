"""The page of an item in a real Chromium, whose policy refuses styles in pictures: `make test-page`."""

from __future__ import annotations

from datetime import date
from pathlib import Path

from chromium import chromium
from lab_people import with_people
from serve_page import Visitor, served

from tests.archive.test_archive import write


def test_the_drift_of_an_item_is_drawn(tmp_path: Path) -> None:
    lab = with_people(tmp_path / "laboratory")
    (lab / "certificates").mkdir()
    for year in range(2021, 2026):
        write(lab / "certificates", f"C-{year}", date(year, 1, 1), value=5.02 + 0.01 * (year - 2025))
    with served(lab) as address, chromium(tmp_path / "profile") as page:
        page.size(390, 800)
        vera = Visitor(page, address)
        vera.logs_in("vera")
        vera.goes("/equipment")
        vera.looks("equipment-due")
        vera.clicks("a[href^='/item/']")
        assert page.ask("document.querySelector('svg.drift').getBoundingClientRect().height") > 100
        vera.looks("item")
        assert page.complaints == []
