"""Crash at every write of a short run, damage every byte of its last commits and its file's every page, and go on.

python -m proving.crashes.crash_points [--lab attitude] [--part crashes|folded|log|file] [--every 1]

Folded: crashes again, in runs whose log is folded into the file every few pages, as that of a long run is in the end.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from proving.crashes.damages import FLIPS, Interrupted, file_damages, log_damages, small_finished
from proving.crashes.runs import PROCEDURES, crash_once
from proving.disk import folding

_PARTS = ("crashes", "folded", "log", "file")
_FOLD_PAGES = 4


def crash_points(lab: str, folder: Path, every: int) -> tuple[Counter[str], list[str]]:
    """Every write and sync, file creation included, with what was not synced kept, lost, or lost in part."""
    counts: Counter[str] = Counter()
    wrong = []
    for lost in ("none", "all", "some"):
        nth, crashed = 1, True
        while crashed:
            crashed, run, verdict = crash_once(lab, folder / f"{lost}-{nth}", nth, lost, seed=nth)
            counts[f"crashed, unsynced {lost} lost" if crashed else "not crashed"] += 1
            counts["resumed with a warning"] += bool(run.warnings)
            if verdict:
                wrong.append(f"{lab}, crash at {nth}, {lost} lost: {verdict}")
            nth += every
    return counts, wrong


def main() -> int:
    """As the command line says; 1 if anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lab", choices=PROCEDURES, action="append")
    parser.add_argument("--part", choices=_PARTS, action="append")
    parser.add_argument("--every", type=int, default=1, help="only every nth crash point or byte")
    asked = parser.parse_args()
    bad = 0
    for lab in asked.lab or PROCEDURES:
        for part in asked.part or _PARTS:
            start = time.process_time()
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                if part == "crashes":
                    counts, wrong = crash_points(lab, folder, asked.every)
                elif part == "folded":
                    with folding(_FOLD_PAGES):
                        counts, wrong = crash_points(lab, folder, asked.every)
                elif part == "log":
                    counts, wrong = log_damages(Interrupted.make(lab, folder), asked.every)
                else:
                    counts, wrong = file_damages(small_finished(lab, folder), FLIPS, asked.every)
            print(f"{lab}, {part} ({time.process_time() - start:.0f} s of processor time)")
            for what, count in sorted(counts.items()):
                print(f"  {count:7d}  {what}")
            for line in wrong:
                print(f"  WRONG: {line}")
            print(f"  {len(wrong):7d}  wrong", flush=True)
            bad += len(wrong)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
