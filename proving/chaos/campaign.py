"""Chaos acts on real controllers in both laboratories, judged by a checker that shares no code with the project.

A server keeps a tape of what the instruments answered and of what was true. A real `rig run` is killed, frozen, cut off
and deceived many times and carried on as its own messages say; then its file is held against the tape.

.venv/bin/python -m proving.chaos.campaign --acts 500 [--seed 1] [--lab pressure] [--only freeze,race]
"""

from __future__ import annotations

import argparse
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from proving.chaos.acts import ACTS
from proving.chaos.bench import LABS, PROJECT
from proving.chaos.checker import KINDS, check
from proving.chaos.run import ChaosRun, Stuck


def one_run(
    seed: int, lab: str, acts: int, folder: Path, only: list[str], done: Counter[str]
) -> tuple[Counter[str], list[str]]:
    """One run with up to so many acts; what is to be counted, and what was found."""
    rng = random.Random(seed)
    run, counts = ChaosRun(LABS[lab], folder, rng), Counter[str]()
    names = only or list(ACTS)
    findings: list[str] = []
    try:
        run.begin()
        for _ in range(acts):
            run.wait(rng.choice((rng.uniform(0, 0.8), rng.uniform(0.5, 2.5), rng.uniform(1.0, 4.0))))
            if run.complete:
                break
            if not run.alive:
                continue
            (name,) = rng.choices(names, [ACTS[n][1] for n in names])
            run.note(f"act {name}")
            ACTS[name][0](run)
            done[name] += 1
            counts["acts"] += 1
        run.finish()
        verdict = check(run.path, run.bench.tape, run.ledger, run.outages)
        counts.update(verdict.counts)
        for kind in KINDS:
            counts[kind] += len(verdict.findings[kind])
            findings += [f"{kind}: {words}" for words in verdict.findings[kind]]
        verified = run.folder / "verified.out"
        if run.spawn("verify", run.path, out=verified).wait():  # what was done to it, it makes sense
            findings.append(f"rig verify: {verified.read_text()[:1000]}")
    except Stuck as stuck:
        findings.append(f"stuck: {stuck}")
    finally:
        run.close()
    for words in run.said:
        print(f"  said: {words}", flush=True)
    findings += run.findings
    counts["runs"] += 1
    counts["sessions"] += run.sessions
    counts["refusals"] += run.refusals
    counts["went on elsewhere"] += run.rescues
    counts["lost and said"] += run.said_lost
    return counts, findings


RUNS = PROJECT / "runs"
"""Not in a memory file system: on the disk that holds the project."""


def main() -> int:
    """As the command line says; 1 if anything was found."""
    RUNS.mkdir(exist_ok=True)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--acts", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=int, default=25, help="acts in one run at most")
    parser.add_argument("--lab", choices=LABS, action="append")
    parser.add_argument("--only", type=lambda text: text.split(","), default=[])
    asked = parser.parse_args()
    total, done, bad, seed = Counter[str](), Counter[str](), 0, asked.seed
    labs = asked.lab or list(LABS)
    while total["acts"] < asked.acts:
        lab, began = labs[seed % len(labs)], time.monotonic()
        folder = Path(tempfile.mkdtemp(prefix=f"chaos-{seed}-", dir=RUNS))
        counts, findings = one_run(seed, lab, min(asked.each, asked.acts - total["acts"]), folder, asked.only, done)
        total += counts
        print(f"seed {seed} ({lab}, {time.monotonic() - began:.0f} s): {dict(counts)}", flush=True)
        for words in findings:
            print(f"  FOUND {words}", flush=True)
        if findings:
            bad += len(findings)
            print(f"  kept in {folder}", flush=True)
        else:
            shutil.rmtree(folder, ignore_errors=True)
        seed += 1
    print(f"acts: {dict(done)}")
    print(f"seeds {asked.seed} to {seed - 1}: {dict(total)}")
    print(", ".join(f"{total[kind]} {kind}" for kind in KINDS) + f"; {bad} findings in all")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
