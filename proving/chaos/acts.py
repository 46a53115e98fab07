"""Acts of chaos on a run: its controller killed, frozen, cut off, deceived; its files tampered with; its bench gone."""

from __future__ import annotations

import contextlib
import os
import random
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from proving.chaos.run import ChaosRun

Act = Callable[[ChaosRun], None]


def killed(run: ChaosRun) -> None:
    """SIGKILL, and a gap of any length before the resume."""
    run.kill()
    run.ended(killed=True)
    _alone(run)
    run.resume()


def _alone(run: ChaosRun) -> None:
    if run.rng.random() < 0.4:
        time.sleep(min(run.rng.choice((0.2, 1.1, 2.0)) * run.lab.gap_s / run.lab.speed, 8.0))


def asked_to_end(run: ChaosRun) -> None:
    """SIGTERM, SIGINT or SIGHUP."""
    run.signal(run.rng.choice((signal.SIGTERM, signal.SIGINT, signal.SIGHUP)))
    _until_ended(run)


def _until_ended(run: ChaosRun, seconds: float = 30.0) -> None:
    assert run.process is not None
    try:
        run.process.wait(seconds)
    except subprocess.TimeoutExpired:
        run.findings.append(f"it did not end within {seconds:g} s")
        run.kill()
    run.ended()
    if not run.complete:
        run.resume()


def _length(run: ChaosRun) -> float:
    """Bench seconds: shorter than a poll, about the hole rule, about the gap rule, far longer."""
    lab, rng = run.lab, run.rng
    about = rng.choice((rng.uniform(0.1, 5.0), lab.hole_s, lab.gap_s, lab.gap_s, rng.uniform(2, 6) * lab.gap_s))
    return float(about * rng.uniform(0.75, 1.35))


def frozen(run: ChaosRun) -> None:
    """SIGSTOP, bench time passes, SIGCONT."""
    run.freeze()
    time.sleep(_length(run) / run.lab.speed)
    run.signal(signal.SIGCONT)


def frozen_and_killed(run: ChaosRun) -> None:
    """SIGSTOP, bench time passes, SIGKILL."""
    run.freeze()
    time.sleep(_length(run) / run.lab.speed)
    killed(run)


def stuttering(run: ChaosRun) -> None:
    """Frozen and let go again and again, each shorter than a hole."""
    with run.outage():  # together they may be a silence of any length
        for _ in range(run.rng.randrange(3, 12)):
            run.freeze()
            time.sleep(run.rng.uniform(0.1, 0.9) * run.lab.hole_s / run.lab.speed)
            run.signal(signal.SIGCONT)
            time.sleep(run.rng.uniform(0.0, 0.1))


def cut_off(run: ChaosRun) -> None:
    """A cable to an instrument is pulled for a while, or carries nothing."""
    relay = run.rng.choice(run.bench.relays)
    with run.outage():
        relay.break_off(silent=run.rng.random() < 0.5)
        run.wait(min(_length(run) / run.lab.speed, 4.0))
        relay.mend()


def server_frozen(run: ChaosRun) -> None:
    """All instruments fall silent for a while."""
    with run.outage():
        run.bench.send(signal.SIGSTOP)
        time.sleep(min(_length(run) / run.lab.speed, 4.0))
        run.bench.send(signal.SIGCONT)


def power_cut(run: ChaosRun) -> None:
    """Every instrument restarts."""
    run.bench.send(signal.SIGUSR1)


def another_bench(run: ChaosRun) -> None:
    """The instruments are gone, and new ones come in their place: nothing of what was prepared is there."""
    with run.outage():
        run.bench.kill()
        run.wait(run.rng.uniform(0, 1))
        run.bench.start()


# --- files ------------------------------------------------------------------------------------------------------


def _cut(path: Path, rng: random.Random) -> None:
    os.truncate(path, rng.randrange(path.stat().st_size + 1))


def _overwrite(path: Path, rng: random.Random) -> None:
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.seek(rng.choice((0, rng.randrange(size + 1))))
        file.write(rng.randbytes(rng.choice((1, 100, 5000, 50_000))))


def _other_content(path: Path, rng: random.Random) -> None:
    kept = path.read_bytes()[: 1 << 12]
    path.write_bytes(kept[: rng.randrange(len(kept) + 1)])


def _unlink(path: Path, _: random.Random) -> None:
    path.unlink()


def _swap(path: Path, _: random.Random) -> None:
    copy = path.with_name("copy")
    shutil.copy(path, copy)
    copy.replace(path)


def _rename(path: Path, rng: random.Random) -> None:
    path.rename(path.with_name(f"moved-{rng.randrange(10**9)}.bin"))


_TAMPERS = (_cut, _overwrite, _other_content, _unlink, _swap, _rename)


def tampered(run: ChaosRun) -> None:
    """File or log is cut, overwritten, replaced, removed or moved under the controller, which lives on or is killed."""
    run.freeze()
    run.look()
    suffix = run.rng.choice(("", "-wal", "-wal"))
    tamper, dies = run.rng.choice(_TAMPERS), run.rng.random() < 0.35
    target = Path(f"{run.path}{suffix}")
    run.note(f"{tamper.__name__} of {target.name}, {'killed' if dies else 'lives on'}")
    with contextlib.suppress(FileNotFoundError):
        tamper(target, run.rng)
    if dies:
        killed(run)
    else:
        run.signal(signal.SIGCONT)


def tampered_while_dead(run: ChaosRun) -> None:
    """The same between two sessions."""
    run.kill()
    run.ended(killed=True)
    tamper, suffix = run.rng.choice(_TAMPERS), run.rng.choice(("", "-wal"))
    target = Path(f"{run.path}{suffix}")
    run.note(f"{tamper.__name__} of {target.name} while nothing runs")
    with contextlib.suppress(FileNotFoundError):
        tamper(target, run.rng)
    run.resume()


def folder_gone(run: ChaosRun) -> None:
    """The folder of the run becomes a file, for a while."""
    if run.path.parent != run.runs:
        return
    run.freeze()
    run.look()
    away = run.runs.with_name("runs-away")
    run.runs.rename(away)
    run.runs.write_text("a file\n")
    run.signal(signal.SIGCONT)
    with contextlib.suppress(subprocess.TimeoutExpired):
        run.process.wait(20)  # type: ignore[union-attr]
    run.runs.unlink()
    away.rename(run.runs)


def disk_full(run: ChaosRun) -> None:
    """No room on the disk, or for the file, for a while."""
    if run.disk.own and run.path.parent == run.runs and run.rng.random() < 0.6:
        ballast = run.disk.fill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.process.wait(run.rng.uniform(0.1, 3.0))  # type: ignore[union-attr]
        ballast.unlink()
        return
    with contextlib.suppress(OSError):
        log = Path(f"{run.path}-wal")
        size = log.stat().st_size if log.exists() else run.path.stat().st_size
        resource.prlimit(run.pid, resource.RLIMIT_FSIZE, (size + run.rng.randrange(9000), resource.RLIM_INFINITY))


# --- several, and clocks ------------------------------------------------------------------------------------


def race(run: ChaosRun) -> None:
    """Several resumes at once; one may carry on, the others say that it does."""
    if run.rng.random() < 0.6:
        run.kill()
        run.ended(killed=True)
    racers = {}
    for n in range(run.rng.randrange(2, 5)):
        out = run.folder / f"racer-{n}.out"
        racers[run.spawn("resume", run.path, "--bench", run.bench.file, out=out)] = out
    end = time.monotonic() + 30
    while sum(p.poll() is None for p in racers) + run.alive > 1 and time.monotonic() < end:
        time.sleep(0.02)
    for process, out in racers.items():
        words = out.read_text(errors="replace")
        if process.poll() is not None:
            if process.returncode not in (0, 1, 2, 5, 75):
                run.findings.append(f"a racer ended with {process.returncode}: {words[-500:]}")
            run.note(f"a racer: exit {process.returncode}: {words.strip()[-300:]}")
        elif run.alive:
            run.findings.append("two controllers carry one run on")
            process.kill()
        else:
            if run.process is not None:  # it was the one that came too late
                run.ended()
            run.process = process
            run.adopt(out)
    if run.process is None and not run.complete:
        run.resume()


def second_name(run: ChaosRun) -> None:
    """A hard link of the run is resumed, while the run goes on or after a kill: refused either way."""
    if not run.path.exists():  # somebody has just taken it away
        return
    if run.rng.random() < 0.5:
        run.kill()
        run.ended(killed=True)
    other = run.path.with_name(f"second-name-{run.rng.randrange(10**9)}.sqlite")
    os.link(run.path, other)
    out = run.folder / "second.out"
    process = run.spawn("resume", other, "--bench", run.bench.file, out=out)
    try:
        code = process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        code = None
    words = out.read_text(errors="replace")
    if code != 2 and not (code == 0 and "is complete" in words):
        run.findings.append(f"a second name was resumed: exit {code}: {words[-500:]}")
    for suffix in ("", "-wal", "-shm", ".head", ".live"):
        Path(f"{other}{suffix}").unlink(missing_ok=True)
    if run.process is None:
        run.resume()


def clock_jump(run: ChaosRun) -> None:
    """Resumed with another clock: the machine's own (in a time namespace), or UTC."""
    run.kill()
    run.ended(killed=True)
    sign, amount = run.rng.choice((1, 1, -1)), run.rng.choice((5, 60, 3600, 10**6))
    if os.geteuid() == 0 and run.rng.random() < 0.6:
        up = time.clock_gettime(time.CLOCK_BOOTTIME)
        seconds = str(max(sign * amount, -int(up) + 60))
        run.resume(
            before=("unshare", "--time", "--fork", "--kill-child", "--monotonic", seconds, "--boottime", seconds)
        )
    else:
        run.resume("--bench", run.bench.moved_utc(sign * amount * run.lab.speed))


def asked_by_a_person(run: ChaosRun) -> None:
    """`rig hold` and `rig release`, or `rig stop`."""
    out = run.folder / "person.out"
    if run.rng.random() < 0.5:
        run.spawn("stop", run.path, out=out).wait()
        return
    run.spawn("hold", run.path, out=out).wait()
    time.sleep(run.rng.uniform(0, 1.5))
    run.spawn("release", run.path, out=out).wait()


ACTS: dict[str, tuple[Act, int]] = {
    "kill": (killed, 4),
    "signal": (asked_to_end, 3),
    "freeze": (frozen, 9),
    "freeze-kill": (frozen_and_killed, 3),
    "stutter": (stuttering, 2),
    "cut": (cut_off, 4),
    "silent": (server_frozen, 3),
    "power-cut": (power_cut, 2),
    "another-bench": (another_bench, 1),
    "tamper": (tampered, 6),
    "tamper-dead": (tampered_while_dead, 2),
    "folder": (folder_gone, 1),
    "disk": (disk_full, 3),
    "race": (race, 3),
    "second-name": (second_name, 2),
    "clock": (clock_jump, 2),
    "person": (asked_by_a_person, 2),
}
