"""Doors that take texts: configuration, tables, formulas, calibrations, contracts, and paths."""

from __future__ import annotations

import contextlib
import json
import os
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from proving.crashes.runs import PROCEDURES
from proving.doors.hostile import Acts, Material, command, damaged, edited, mutated, words
from rig.bench.config import parse_bench, parse_procedure
from rig.bench.contract_files import with_contracts
from rig.bench.plugins import installed
from rig.examples import example
from rig.fitter.arithmetic_text import FormulaError
from rig.fitter.effects.own import own_effects
from rig.fitter.formula import Formula
from rig.procedures.kinds import kinds
from rig.runs.controller import opened
from rig.runs.plans import plan_of

LABS = tuple(sorted(PROCEDURES))


def _examples(material: Material) -> dict[tuple[str, str], str]:
    """Texts of the two laboratories, by laboratory and file."""
    if "examples" not in material.made:
        material.made["examples"] = {
            **{(lab, n): (example(f"{lab}-lab") / n).read_text() for lab in LABS for n in ("bench.toml", "world.toml")},
            **{(lab, "procedure.toml"): (example(f"{lab}-lab") / "procedure.toml").read_text() for lab in LABS},
        }
    found: dict[tuple[str, str], str] = material.made["examples"]
    return found


def documents(rng: random.Random, material: Material) -> dict[str, str]:
    """The files of a laboratory."""
    lab = rng.choice(LABS)
    found = {name: _examples(material)[lab, name] for name in ("bench.toml", "world.toml", "procedure.toml")}
    if rng.random() < 0.5:
        found["procedure.toml"] = PROCEDURES[lab]
    return found


def toml(rng: random.Random, material: Material) -> Acts:
    """Bench, world and procedure files; notify.toml is with the messages."""
    given = documents(rng, material)
    name = rng.choice(sorted(given))
    if rng.random() < 0.9:
        given[name] = edited(given[name], rng)
    else:
        given[name] = damaged(given[name].encode(), rng).decode("utf-8", "replace")
    if name == "bench.toml":
        yield lambda: parse_bench(given[name], name)
    if name == "procedure.toml":
        yield lambda: parse_procedure(given[name], name, strict=rng.random() < 0.5)
    if name == "world.toml" or rng.random() < 0.2:
        yield lambda: plan_of(given, dry=True, stored=rng.random() < 0.3)
    if rng.random() < 0.01:
        folder = material.path("files")
        folder.mkdir()
        for one, text in given.items():
            (folder / one).write_text(text, encoding="utf-8", errors="replace")
        bench, world = folder / "bench.toml", folder / "world.toml"
        yield lambda: command("doctor", "--bench", bench, "--dry", "--world", world, "--out", folder, "--json")


_CELLS = (
    "", "1_5", "nan", "inf", "1e999", '"', "=1+1", "a,b", "\0", "\r", "-", "x", "1" * 5000, "\uff11", "1e308",
    "-1e308", '"a\nb"', "true", "0x10", " 1 ", "1e-320", "\u202e", ";", "\t", "\x1b[2J", "[red]", "2026-01-01", "0",
    "1" * 400,
)  # fmt: skip
_COLUMNS = (
    ("pitch_deg", "roll_deg", "x_V", "y_V", "z_V", "replicate", "sensor_temperature_degC"),
    ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC", "p_V", "whole_plot", "replicate"),
    ("a", "b", "y"),
)


_LINES = (
    "", "# remark", "x;y", "kN;mV", "a b c", "1;2;3", "***End***", "---", '"quoted', "Data:  y  x", "1.234;5,6",
    "03/04/2026",
)  # fmt: skip


def _as_others_write(text: str, rng: random.Random) -> str:
    """A table with another separator and decimal sign, and with lines around it."""
    separator = rng.choice(";\t| ,")
    if separator != ",":
        text = text.replace(",", separator)
        text = text.replace(".", ",") if rng.random() < 0.5 else text
    lines = text.split("\n")
    for _ in range(rng.randrange(4)):
        lines.insert(rng.choice((0, 0, 1, rng.randrange(len(lines) + 1), len(lines))), rng.choice(_LINES))
    for _ in range(rng.randrange(3)):
        at = rng.randrange(len(lines))
        cells = lines[at].split(separator)
        cells[rng.randrange(len(cells))] = rng.choice(
            ("NA", "-", "1,234", "1.234", "2026-01-15", "up", "+", "1'234,5", "\u2212")
        )
        lines[at] = separator.join(cells)
    return rng.choice(("\n", "\n", "\r\n", "\r")).join(lines)


def csv(rng: random.Random, material: Material) -> Acts:
    """Tables."""
    names = list(rng.choice(_COLUMNS))
    rows = [[f"{rng.gauss(0, 50):.6g}" for _ in names] for _ in range(rng.choice((0, 1, 3, 9, 30)))]
    lines = [names, *rows]
    for _ in range(rng.randrange(4)):
        row = rng.choice(lines)
        row[rng.randrange(len(row))] = rng.choice(_CELLS)
    if rng.random() < 0.1:
        rng.choice(lines).append(rng.choice(_CELLS))
    text = "\n".join(map(",".join, lines))
    if rng.random() < 0.002:
        text = ",".join(f"c{n}" for n in range(100_000)) + "\n" + ",".join([rng.choice(_CELLS[:4])] * 100_000)
    if rng.random() < 0.4:
        text = _as_others_write(text, rng)
    encoding = rng.choice(("utf-8", "utf-8", "utf-8", "utf-16", "cp1252", "cp1251"))
    data = text.encode(encoding, "replace")
    path = material.path("table.csv")
    path.write_bytes(damaged(data, rng) if rng.random() < 0.1 else data)
    out, response = material.folder / "answer.csv", names[2]
    asked: list[tuple[object, ...]] = [
        *[("fit", path, "--json", "--response", response, "--formula", f"1 + {names[0]}")] * 5,
        *[("fit", path, "--json")] * 5,
        ("trace", path, "--json"),
        ("fit", path, "--header", rng.randrange(4), "--decimal", rng.choice(("point", "comma")), "--json"),
        ("fit", path, "--out", out, "--response", response, "--formula", "1 + a", "--whole-plot", names[-2]),
        ("chart", f"{path}@2026-01-01", f"{path}@2026-02-01", "--json"),
        ("infer", _calibration_path(material), path, "--out", out, "--json"),
        ("infer", _calibration_path(material), path, "--zero", path, "--out", out, "--json"),
    ]
    if rng.random() < 0.01:
        asked = [("trace", path, "--json"), ("trace", path, "--response", response, "--json")]
    chosen = rng.choice(asked)
    yield lambda: command(*chosen)


def _calibration_path(material: Material) -> Path:
    path = material.folder / "good.json"
    if not path.exists():
        path.write_text(json.dumps(material.calibrations[0]))
    return path


_WORDS = ("P", "T", "1", "0", "I(", "C(", "log(", "(", ")", ")^2", "^", "*", ":", "+", "-", "/", "~", "1e999", "\u00b2")
_MORE: tuple[str, ...] = (
    "sqrt(", "exp(", "9" * 400, "^9", "**", "P^2", "T:P", "\0", "\n", "'", ".", ",", "1_5", "\uff11", "e", "-1",
)  # fmt: skip
_MORE += ("max(", "<", "==", "`P`", "`")
_EFFECT = ("pitch", "+", "**", "sin(", ")", "9", "1e9", "-", "roll", "(", "min(", ",", "<")
_AGAIN = ("P+", "P*", "-", "(P+T)*", "P:", "P<", "P^", "max(P,", "`")


def formula(rng: random.Random, _: Material) -> Acts:
    """Models and effects of a user's own."""
    text = "".join(words(rng, _WORDS + _MORE if rng.random() < 0.3 else _WORDS, 25))
    if rng.random() < 0.03:
        text = rng.choice(("I(", "log(", "(", "")) + rng.choice(_AGAIN) * 2000 + "P)"
    table: Mapping[str, Any] = {"P": np.linspace(1, 2, 5), "T": np.array([1.0, 1, 2, 2, 3])}

    def parse() -> None:
        with contextlib.suppress(FormulaError):
            found = Formula.parse(text)
            assert Formula.parse(str(found)) == found
            with contextlib.suppress(KeyError, ValueError):
                found.columns(table)

    effect = json.dumps("".join(words(rng, _EFFECT, 20)))
    fields = dict.fromkeys(("name", "cause", "scope", "stratum", "unit", "separate_by", "usual_size"), '"x"')
    fields |= {"scope": '"sensor"', "stratum": '"between-point"', "columns": f"[{effect}]"}
    written = edited("[[effect]]\n" + "\n".join(f"{k} = {v}" for k, v in fields.items()), rng)

    def effects() -> None:
        with contextlib.suppress(ValueError):
            own_effects(written, [one.own_effects for one in kinds().values() if one.own_effects])

    yield effects if rng.random() < 0.25 else parse


def calibration(rng: random.Random, material: Material) -> Acts:
    """A calibration file of `rig fit --out`."""
    content = mutated(rng.choice(material.calibrations), rng)
    text = json.dumps(content).encode()
    path = material.path("changed.json")
    path.write_bytes(damaged(text, rng) if rng.random() < 0.1 else text)
    table, out = material.path("reading.csv"), material.folder / "answer.csv"
    heads = "x_V,y_V,z_V,sensor_temperature_degC" if "sensors" in str(content)[:3000] else "p_V"
    table.write_text(f"{heads},sse_temperature_degC,vacuum\n" + "0.1,0.2,0.9,20,20,1\n" * 2)
    asked: list[tuple[object, ...]] = [
        ("chart", f"{path}@2026-01-01", f"{path}@2026-02-01", "--json"),
        ("chart", path, _calibration_path(material), "--json"),
        *[("infer", path, table, "--out", out, "--json")] * 2,
    ]
    if rng.random() < 0.02:
        asked = [("chart", path, f"{path}@2026-02-01", "--report", material.folder / "answer.html")]
    chosen = rng.choice(asked)
    yield lambda: command(*chosen)


def contracts(rng: random.Random, material: Material) -> Acts:
    """EDS, DBC and register maps, given to drivers and twins."""
    given = documents(rng, material)
    bench = given["bench.toml"]
    supplied = {driver: with_contracts(driver, {}) for driver in installed("rig.drivers") if f'"{driver}"' in bench}
    driver = rng.choice([driver for driver, texts in supplied.items() if texts])
    ((option, text),) = supplied[driver].items()
    changed = (
        edited(text, rng, _CONTRACT_VALUES) if rng.random() < 0.7 else damaged(text.encode(), rng).decode("latin-1")
    )
    lines = bench.splitlines()
    at = next(n for n, line in enumerate(lines) if f'"{driver}"' in line)
    lines.insert(at + 1, f"{option} = {json.dumps(changed)}")
    given["bench.toml"] = "\n".join(lines)

    def begun() -> None:
        with opened(plan_of(given, dry=True)):
            pass

    yield begun


_CONTRACT_VALUES = (
    *("", "0", "-1", "0xFFFFFFFFFF", "nan", "1e999", "x", "1" * 5000, "$NODEID+0x", '"x"', "[1, 2]", "0x1000", "true"),
    *("256", "65536", "4294967296", "[[", "{", "\0", "%", "=", "$NODEID*", "0b1", "1_5", "-0x1", "x" * 5000, "7.5"),
)

_ODD_NAMES = (
    "a\nb.sqlite", "-x.sqlite", "=1.sqlite", "[red].sqlite", "x" * 250, "%s.sqlite", "\udcff.sqlite", "a b'\".json",
)  # fmt: skip


def odd_path(rng: random.Random, material: Material) -> Path:
    """A path to something that nobody should give."""
    base = material.path("odd")
    base.mkdir()
    suffix = rng.choice((".sqlite", ".csv", ".json", ".toml", ""))
    path = base / f"odd{suffix}"
    match rng.randrange(14):
        case 0:
            os.mkfifo(path)
        case 1:
            path.symlink_to("/dev/zero")
        case 2:
            path.symlink_to(path)
        case 3:
            path.mkdir()
        case 4:
            path.write_bytes(b"")
        case 5:
            path.write_bytes(rng.randbytes(rng.randrange(3000)))
        case 6:
            path.symlink_to(material.run)
        case 7:
            path = base / rng.choice(_ODD_NAMES)
            path.write_bytes(material.run.read_bytes())
        case 8:
            return Path(
                rng.choice(("/dev/zero", "/dev/full", "/dev/null", "/proc/self/mem", "/proc/self/maps", "/", ""))
            )
        case 9:
            path = base / "gone" / f"x{suffix}"
        case 10:
            return Path(rng.choice(("a\0b", "\ud800.sqlite", "x" * 5000, "/" * 3000, "~nobody/x", "a\nb@2026-01-01")))
        case 11:
            path.write_bytes(b"SQLite format 3\0" + rng.randbytes(2000))
        case 12:
            os.mkfifo(base / "run.sqlite")
            return base
        case _:
            path.symlink_to("/nowhere")
    return path


def paths(rng: random.Random, material: Material) -> Acts:
    """Pipes, devices, folders, links and odd names as any file that a command takes, to read and to write."""
    path, run, base = odd_path(rng, material), material.run, material.folder / "odd"
    good, answer = _calibration_path(material), material.folder / "answer.csv"
    bench = example("attitude-lab") / "bench.toml"
    asked: tuple[tuple[object, ...], ...] = (
        *((name, path) for name in ("status", "verify", "service", "hold", "release", "stop", "resume", "fit")),
        *(("status", path, "--check", "--json"), ("verify", path, "--json"), ("fit", path, "--json")),
        *(("export", path, "--out", answer), ("chart", path, path), ("chart", f"{path}@2026-01-01", good)),
        *(("chart", run, path, "--json"), ("infer", path, path, "--out", answer), ("infer", good, path, "-o", answer)),
        *(("run", path, "-b", path, "--dry", "--out", base), ("run", path, "-b", bench, "--dry", "--out", base)),
        *(("doctor", "--bench", path), ("doctor", "--run", path), ("doctor", "--notify-file", path, "--out", base)),
        *(("plan", path, "-b", path), ("confirm", path, "--list"), ("trace", path), ("service", run, "--bench", path)),
        *(("confirm", run, "--by", path), ("resume", run, "--bench", path), ("verify", path, "--restore", answer)),
        *(("infer", good, good, "--zero", path, "-o", answer), ("fit", run, "--confirmed-by", path)),
    )
    if path.is_relative_to(base) and rng.random() < 0.3:  # never over a device of this machine
        asked = (
            *(
                ("export", run, "--out", path, "--all"),
                ("infer", good, path, "--out", path),
                ("fit", run, "--out", path),
            ),
            *(("verify", run, "--restore", path), ("fit", run, "--report", path), ("doctor", "--out", path)),
            *(
                ("chart", run, run, "--report", path),
                ("run", good, "-b", bench, "-o", path),
            ),
        )
    chosen = rng.choice(asked)
    yield lambda: command(*chosen)
