"""Certificates of random simulated runs: `python -m proving.certificates.runs --count 150 --schema dcc.xsd`.

Each seed is a stand with one to three sensors, its register, a run, and its certificate. The XML is held to PTB's
schema and Schematron and read back; every number of the page is looked for in the run file, the settings, and what a
budget of the run file has. Coefficients are fitted a second time, by numpy alone, from its observations.
"""

from __future__ import annotations

import argparse
import datetime
import json
import random
import re
import tempfile
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from proving.certificates.campaign import Check, by_schema, not_read_back, rules
from rig.certificate import words
from rig.certificate.document import Document
from rig.certificate.numbers import plain
from rig.controller import start_run
from rig.engine.session import Signals
from rig.plans import load_plan
from rig.results.budget import budget
from rig.results.certificate import Asked, Issue, Made, Refused, issue, make
from rig.run_file.reader import RunReader
from rig.tables import run_table

ISSUED = datetime.date(2026, 11, 24)
_TOKEN = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
DUE = "number = '{number}'\ndate = 2020-02-03\ndue = 2040-01-01\nlaboratory = 'An institute'\n"


class Stand:
    """The files of a random stand, by a seed, and a certificate of its run."""

    def __init__(self, seed: int, folder: Path) -> None:
        self._of, self.folder = random.Random(seed), folder
        of = self._of
        self.names = [f"cell_{letter}" for letter in "abc"[: of.randint(1, 3)]]
        self.top = of.choice((1.0, 5.0, 20.0, 100.0))
        self.degree = of.choice((1, 1, 2))
        count = of.randint(3 + self.degree, 6)
        self.levels = [round(self.top * n / (count - 1), 3) for n in range(count)]
        self.points = sorted(round(of.uniform(0.1, 0.95) * self.top, 2) for _ in range(of.randint(1, 3)))
        terms = {name: self._coefficients() for name in self.names}
        self._write("procedure", self._procedure())
        self._write("bench", self._bench())
        self._write("world", self._world(seed, terms))
        self._write("equipment", self._register())
        self._write("certificate", self._settings())

    def _coefficients(self) -> list[float]:
        of = self._of
        return [of.uniform(-0.5, 0.5), of.uniform(0.5, 5) / self.top, of.uniform(-0.1, 0.1) / self.top**2]

    def _write(self, name: str, text: str) -> None:
        (self.folder / f"{name}.toml").write_text(text)

    def _procedure(self) -> str:
        of = self._of
        formula = " + ".join(["1", "force_kN", "force_kN^2"][: self.degree + 1])
        return (
            f"kind = 'general'\nname = 'random stand'\nseed = {of.randrange(99)}\nreplications = {of.randint(2, 4)}\n"
            f"[factors.force_kN]\nlevels = {self.levels}\norder = '{of.choice(('up-down', 'as written', 'random'))}'\n"
            f"[settle]\ndwell_s = 5\n[measure]\nreadings = {of.randint(2, 5)}\n[model]\nformula = '{formula}'\n"
        )

    def _bench(self) -> str:
        sensors = "".join(f"[sensors.{name}]\nreader = 'dvm_{name}'\n" for name in self.names)
        meters = "".join(
            f"[instruments.dvm_{name}]\ndriver = 'keysight-34401a'\naddress = '/dev/rig/{name}'\nnplc = 1\n"
            f"asset = 'DVM-{name}'\n"
            for name in self.names
        )
        person = "[instruments.operator]\ndriver = 'person'\nasset = 'W-1'\n"
        factors = f"[factors]\nforce_kN = 'operator'\n[limits]\nforce_kN = [0, {2 * self.top}]\n"
        return f"name = 'random stand'\nequipment = 'equipment.toml'\n{meters}{person}{sensors}{factors}"

    def _world(self, seed: int, terms: dict[str, list[float]]) -> str:
        noise = 10 ** self._of.uniform(-5.5, -3.5)
        sensors = "".join(
            f"[sensors.{name}]\nformula = '{b:.9f} + {s:.9f}*force_kN + {c if self.degree > 1 else 0.0:.9f}*force_kN^2'"
            f"\nnoise = {noise:.3e}\n"
            for name, (b, s, c) in terms.items()
        )
        return f"seed = {seed + 1}\n{sensors}[person]\nsets_s = 20\n"

    def _says(self, asset: str, quantity: str, unit: str) -> str:
        of = self._of
        behaves, units = of.choice((("gain", ("ppm", "%")), ("offset", (unit,)), ("setting", (unit,))))
        size = f"{10 ** of.uniform(-5, -3):.2e}" if behaves != "gain" else f"{of.uniform(0.001, 0.02):.4f}"
        how = of.choice(
            (
                f"expanded = {size}\nk = 2\nprobability = 0.95",
                f"standard = {size}\ndf = {of.randint(5, 60)}",
                f"half_width = {size}",
            )
        )
        more = of.choice(("", f"drift = {size}\n", f"resolution = {size}\n"))
        return (
            f"[[equipment.{asset}.says]]\nquantity = '{quantity}'\nbehaves = '{behaves}'\nunit = '{of.choice(units)}'\n"
            f"{how}\n{more}"
        )

    def _register(self) -> str:
        parts = ["name = 'random stand'\n[laboratory]\nname = 'A laboratory'\naddress = '1 Road'\n"]
        meters = [(f"DVM-{name}", "V", "V") for name in self.names]
        for n, (asset, quantity, unit) in enumerate([("W-1", "force_kN", "kN"), *meters]):
            parts.append(
                f"[equipment.{asset}]\nmaker = 'M'\nmodel = 'T {n}'\nserial = 'S{self._of.randrange(10**5)}'\n"
            )
            parts.append(f"[equipment.{asset}.certificate]\n" + DUE.format(number=f"C-{self._of.randrange(10**5)}"))
            parts += [self._says(asset, quantity, unit) for _ in range(self._of.randint(1, 2))]
        for name in self.names:
            serial = self._of.randrange(10**6)
            parts.append(
                f"[sensors.{name}]\nmaker = 'Cells'\nmodel = 'C'\nserial = '{serial}'\ncustomer = 'Somebody'\n"
            )
            parts.append("customer_address = '2 Road'\ncondition = 'clean'\n")
        return "".join(parts)

    def _settings(self) -> str:
        of, at = self._of, ", ".join(f"{{ force_kN = {point} }}" for point in self.points)
        rule = of.choice(("simple", "guard-band", "probability", "shared-risk"))
        tolerance = "[[tolerance]]\nresult = 'coefficient 1'\nunit = 'V'\nlower = -0.4\nupper = 0.4\n"
        return (
            "number = 'R-{year}-{next:04d}'\ncountry = 'GB'\nitem = 'Load cell'\ncalibrated_by = 'A. B.'\n"
            f"approved_by = 'C. D.'\nat = [{at}]\nannex = '{of.choice(('all', 'largest'))}'\n"
            f"[method]\nname = 'comparison with weights'\n[decision]\nrule = '{rule}'\n"
            + (tolerance if of.random() < 0.5 else "")
        )

    def run(self) -> Path:
        """The finished run file."""
        files = [self.folder / f"{name}.toml" for name in ("procedure", "bench")]
        plan = load_plan(files[0], files[1], dry=True, world=self.folder / "world.toml")
        paths: list[Path] = []
        start_run(plan, self.folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
        return paths[0]


def coefficients_again(run: Path, stand: Stand, document: Document) -> Iterator[str]:
    """Printed coefficients that are not those of least squares by numpy, to half a unit of their last place."""
    table = run_table(run)
    columns = np.vander(table.columns["force_kN"], stand.degree + 1, increasing=True)
    for one in document.tables:
        if not one.sensor:
            continue
        output = next(column for column, name in table.outputs.items() if name == one.sensor)
        found = np.linalg.lstsq(columns, table.columns[output], rcond=None)[0]
        printed = [result for result in one.results if result.label.startswith("coefficient ")]
        if len(printed) != len(found):
            yield f"{one.sensor}: {len(printed)} coefficients are printed, of {len(found)}"
        for result, value in zip(printed, found.tolist(), strict=False):
            if abs(float(result.value) - value) > 0.501 * last_place(result.value):
                yield f"{one.sensor}, {result.label}: {result.value} is printed, numpy has {value!r}"


def last_place(text: str) -> float:
    """One unit of the last digit of a number."""
    digits, _, power = text.lower().partition("e")
    return float(10.0 ** (int(power or 0) - len(digits.partition(".")[2])))


def page_text(page: str) -> str:
    """Text of a page, with plain numbers."""
    body = page.partition("<body")[2]
    text = re.sub(r"<(style|script|svg)\b.*?</\1>", " ", body, flags=re.DOTALL)
    text = unescape(re.sub("<[^>]*>", " ", text)).replace("\u202f", "").replace("−", "-")
    return re.sub(" × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda power: plain(f"1{power[0]}")[1:], text)


def numbers_of(told: Any) -> Iterator[float]:
    """All finite numbers in JSON values."""
    if isinstance(told, dict):
        told = list(told.values())
    if isinstance(told, list | tuple):
        for one in told:
            yield from numbers_of(one)
    elif isinstance(told, int | float) and np.isfinite(told):
        yield float(told)


def conforming(result: dict[str, Any]) -> float:
    """Probability in percent that a result is inside the tolerance of every stand."""
    df = min(result["df"], 1e9) if result["df"] else 1e9
    ends = [(end - result["value"]) / result["standard_uncertainty"] for end in (-0.4, 0.4)]
    low, high = special.stdtr(df, ends)
    return float(100.0 * (high - low))


def sources(run: Path, stand: Stand, made: Made) -> tuple[list[float], str]:
    """Numbers that follow from the run file alone, and texts of the run file, of the settings, and fixed ones."""
    settings = made.settings
    with RunReader.open(run) as reader:
        kept = [*reader.documents().values(), reader.about().run_id, str(reader.head()[0]), reader.head()[1].hex()]
    table = run_table(run)
    kept.append(json.dumps(dict(table.provenance), default=str))
    at = [{"force_kN": point} for point in stand.points]
    numbers: list[float] = [float(len(table)), 100.0 * settings.probability]
    for shapes in (False, True):
        told = budget(run, at=at, probability=settings.probability, same_meter=settings.same_meter, shapes=shapes)
        for result in told.to_json()["results"]:
            numbers += numbers_of(result)
            numbers += [100.0 * line["share"] for line in result["contributions"]]
            numbers += [conforming(result), 99.9, 0.1]  # a probability beyond these is printed as one of them
    fixed = json.dumps({name: text for name, text in vars(words).items() if name.isupper()}, default=str)
    kept.append(settings.decision.words)
    return numbers, " ".join([*kept, (stand.folder / "certificate.toml").read_text(), fixed])


def not_in_run(page: str, numbers: list[float], texts: str, document: Document) -> list[str]:
    """Numbers of a page that are neither in a text nor, rounded, one of the numbers."""
    said = set(_TOKEN.findall(texts))
    said |= {token.lstrip("+-") for token in said}
    number, sorted_numbers = document.number, np.sort(np.abs(numbers))
    counted = {str(n) for n in range(1 + max(len(document.budgets), len(document.equipment), 9))}
    known = {*said, *counted, *_TOKEN.findall(number), *_TOKEN.findall(str(document.dates.issued))}
    known |= {token.lstrip("+-") for token in known}
    found = []
    for one in document.evidence:
        for fingerprint in (one.head, one.run_id):  # broken into lines anywhere
            broken = re.compile(r"\s*".join(map(re.escape, fingerprint)))
            found += [] if broken.search(page) else [f"page: {fingerprint} is not whole"]
            page = broken.sub(" ", page)
    for token in dict.fromkeys(_TOKEN.findall(page)):
        if token in known or token.lstrip("+-") in known:
            continue
        size = abs(float(token))
        near = np.searchsorted(sorted_numbers, [size - last_place(token), size + last_place(token)])
        if near[0] == near[1]:
            found.append(f"page: {token} is not in the run file")
    return found


def violations(seed: int, folder: Path, checks: list[Check]) -> list[str]:
    """All that is wrong with the certificate of the run of a seed."""
    stand = Stand(seed, folder)
    run = stand.run()
    made = make(Asked((run,), ISSUED, settings=folder / "certificate.toml"))
    issued = issue(made, Issue(folder / "out"))
    document, files = issued.document, {path.suffix: path for path in issued.files}
    xml = files[".xml"].read_bytes()
    found = [one for check in checks for one in check(xml)] + not_read_back(document, xml)
    numbers, texts = sources(run, stand, made)
    page = files[".html"].read_text()
    found += not_in_run(page_text(page), numbers, texts, document)
    found += coefficients_again(run, stand, document)
    return found


def main() -> int:
    """Exit code 1 if anything is wrong with any certificate, or a run has none."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--count", type=int, default=150)
    options.add_argument("--first", type=int, default=0, help="first seed")
    options.add_argument("--schema", type=Path, help="PTB's schema 3.2.0; without it only the Schematron is checked")
    asked = options.parse_args()
    checks = [rules(), *([by_schema(asked.schema)] if asked.schema else [])]
    wrong, refused = 0, 0
    for seed in range(asked.first, asked.first + asked.count):
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = violations(seed, Path(folder), checks)
            except Refused as why:
                refused += 1
                print(f"seed {seed}: refused: {why.reasons[0]}", flush=True)
                continue
        wrong += bool(found)
        for one in found[:5]:
            print(f"seed {seed}: {one}", flush=True)
    how = "schema and Schematron" if asked.schema else "Schematron"
    made = asked.count - refused
    print(f"{asked.count} runs: {refused} refused; {made} certificates by {how}: {wrong} with something wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
