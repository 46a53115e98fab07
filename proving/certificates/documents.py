"""Random certificates: any number of items, both stages, any unit, numbers of twenty decades, any alphabet."""

from __future__ import annotations

import datetime
import random
from collections.abc import Sequence
from typing import Literal

from rig.fitter.rounding import rounded, rounded_df, rounded_factor
from rig.verbs.certificate.document import (
    Amendment,
    Condition,
    Dates,
    Document,
    Equipment,
    Evidence,
    External,
    Holding,
    Item,
    Laboratory,
    Logo,
    Method,
    Party,
    Person,
    Supplied,
)
from rig.verbs.certificate.measured import (
    Budget,
    Column,
    Contribution,
    Effect,
    Result,
    ResultTable,
    Stage,
    Statement,
    Verdict,
)

UNITS = (
    *(
        "",
        "V",
        "mV",
        "uV",
        "mV/psi",
        "mV/psi^2",
        "mV/(psi*degC)",
        "kN",
        "degC",
        "deg",
        "arcsec",
        "ppm/degC",
        "%",
        "ohm",
    ),
    *("psi", "V/kN", "V/kN^2/degC", "hPa", "m/s^2", "1/degC", "V per unit of log(force_kN)", "counts"),
)
COLUMN_UNITS = ("psi", "degC", "kN", "deg", "V", "", "mbar")
IN_FONTS = (
    "abcdefghijklmnopqrstuvwxyz ABC-_.,;:()0123456789",
    "äöüßéèñçøåÄÖÜ ",
    "Привет мир ",
    "<>&\"'`#$*_\\@{}[]|~^%/ ",
    "\t\n\r\x00\x07\x1b\u202e",
)
"""Alphabets that the fonts of a page have; control characters are shown by their numbers."""
ALPHABETS = (*IN_FONTS, "校正証明書 ", "مرحبا ", "\u200b\ufeff\ufffe\ufdd0")
VERDICTS: tuple[Verdict, ...] = ("pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail")
LOGO = Logo(b'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><rect width="9" height="9"/></svg>', "svg")


class Random:
    """Random parts of a certificate, by one seed."""

    def __init__(self, seed: int, alphabets: Sequence[str] = ALPHABETS) -> None:
        self._of = random.Random(seed)
        self._alphabets = alphabets

    def text(self, most: int = 40) -> str:
        """A text that is not empty, mostly of one alphabet."""
        alphabet = self._of.choice((*[self._alphabets[0]] * 6, *self._alphabets))
        return "".join(self._of.choice(alphabet) for _ in range(self._of.randint(1, most))).strip() or "x"

    def maybe(self) -> str:
        """A text, or nothing."""
        return self.text(20) if self._of.random() < 0.6 else ""

    def day(self) -> datetime.date:
        """A date of this century."""
        return datetime.date(2001, 1, 1) + datetime.timedelta(days=self._of.randrange(36000))

    def texts(self, most: int) -> tuple[str, ...]:
        """Up to so many texts."""
        return tuple(self.text(80) for _ in range(self._of.randint(0, most)))

    def result(self, n: int, label: str, at: tuple[str, ...], unit: str) -> Result:
        """A result with an uncertainty of any size, rounded as all are."""
        k, standard = self._of.uniform(1.0, 13.0), 10 ** self._of.uniform(-12, 8)
        value = self._of.choice((0.0, 1.0, -1.0)) * standard * 10 ** self._of.uniform(-2, 6)
        both = rounded(value, k * standard)
        power = f"e{both.exponent:+03d}" if both.exponent else ""
        expanded, shown = f"{both.uncertainty_text}{power}", f"{both.value_text}{power}"
        probability = self._of.choice(("0.95", "0.9545", "0.99", "0.6827"))
        df = self._of.choice((float("inf"), self._of.uniform(1, 500)))
        return Result(f"r{n}", label, at, shown, expanded, rounded_factor(k), probability, unit, value, standard, k, df)

    def table(self, sensor: str, stage: Stage) -> ResultTable:
        """Results at settings, or without any."""
        if self._of.random() < 0.4:
            at = tuple(Column(self.text(12), self._of.choice(COLUMN_UNITS)) for _ in range(self._of.randint(1, 3)))
            label, unit = self.text(12), self._of.choice([one for one in UNITS if one not in ("counts", UNITS[-2])])
            rows = tuple(
                self.result(n, label, tuple(f"{self._of.uniform(-9, 9):.3f}" for _ in at), unit)
                for n in range(self._of.randint(1, 30))
            )
        else:
            at = ()
            rows = tuple(
                self.result(n, self.text(30), (), self._of.choice(UNITS)) for n in range(self._of.randint(1, 12))
            )
        return ResultTable(sensor, self.text(), rows, at, stage, self.texts(2))

    def party(self, country: str) -> Party:
        """Somebody with an address."""
        return Party(self.text(), self.texts(3), country, self.maybe(), self.maybe())

    def item(self, name: str) -> Item:
        """A sensor under calibration."""
        words = (self.text(), self.text(), self.text(), self.text(), self.text())
        theirs = tuple(one for one in ("maker", "model", "serial") if self._of.random() < 0.2)
        return Item(name, *words, self.maybe(), self.maybe(), theirs)

    def equipment(self) -> Equipment:
        """An instrument, with a certificate or without."""
        known = self._of.random() < 0.7
        number, laboratory = (self.text(20), self.text()) if known else ("", "")
        day, due = (self.day(), self._of.choice((None, self.day()))) if known else (None, None)
        maker, model, serial, asset = (self.maybe() for _ in range(4))
        return Equipment(self.text(20), maker, model, serial, asset, number, laboratory, day, due, self.maybe())

    def holding(self, stage: Stage) -> Holding:
        """A condition of a certificate, recorded or not."""
        found = ("21.03 to 21.92", self.text(20)) if self._of.random() < 0.6 else ("", "")
        return Holding(self.text(12), self.text(20), self.text(12), "°C", "18 to 28", *found, stage)

    def external(self, sensor: str) -> External:
        """A result of somebody else, with its uncertainty or without."""
        one = self.result(0, self.text(20), (), self._of.choice(UNITS))
        numbers = (one.expanded, one.k, one.probability) if self._of.random() < 0.6 else ("", "", "")
        of, accreditation, number, day, used_for = self.text(), self.maybe(), self.text(20), self.day(), self.maybe()
        return External(sensor, one.label, one.value, one.unit, *numbers, of, accreditation, number, day, used_for)

    def supplied(self, subject: str) -> Supplied:
        """Something that the customer states."""
        return Supplied(subject, self.text(20), self.maybe(), self._of.choice(("", "results", "conformity")))

    def budget(self, table: ResultTable) -> Budget:
        """The budget of a result."""
        one = self._of.choice(table.results)
        lines = tuple(
            Contribution(self.text(), self.maybe(), self._kind(), one.expanded, rounded_df(one.df), share)
            for share in (self._of.uniform(-0.1, 1.0) for _ in range(self._of.randint(1, 8)))
        )
        df = rounded_df(one.df)
        return Budget(
            table.sensor, one.name, one.label, one.unit, lines, one.expanded, df, one.k, one.expanded, table.stage
        )

    def _kind(self) -> Literal["A", "B"]:
        return self._of.choice(("A", "B"))

    def statement(self, table: ResultTable) -> Statement:
        """Some statement of conformity about a table."""
        verdict = self._of.choice(VERDICTS)
        words = (self.text(), self.text(30), self.text(60))
        probability = self._of.choice(("0.998", "> 0.999", "< 0.001"))
        return Statement(table.sensor, *words, verdict, probability, self.text(80), table.stage)

    def document(self) -> Document:
        """A whole certificate."""
        of = self._of
        names = tuple(f"sensor_{n}" for n in range(of.randint(1, 7)))
        stages: Sequence[Stage] = ("as found", "as left") if of.random() < 0.3 else ("",)
        tables = tuple(self.table(name, stage) for stage in stages for name in (*names, *([""] * of.randint(0, 1))))
        days = sorted(self.day() for _ in range(4))
        judged = [one for one in tables if of.random() < 0.4]
        return Document(
            number=f"K-{of.randrange(10**6)}",
            simulated=of.random() < 0.3,
            laboratory=Laboratory(self.party("GB"), self.maybe(), of.choice((None, LOGO))),
            customer=self.party(of.choice(("", "DE", "JP"))),
            items=tuple(self.item(name) for name in names),
            place=self.text(),
            dates=Dates(of.choice((None, days[0])), *days[1:]),
            calibrated_by=tuple(Person(self.text(), self.text(20)) for _ in range(of.randint(1, 3))),
            approved_by=Person(self.text(), self.text(20)),
            method=Method(self.text(), self.texts(3), self.texts(2)),
            conditions=tuple(
                Condition("c", self.text(20), of.choice(("°C", "degC", "hPa", "%")), "1.00", "2.50", "1.3e+02", stage)
                for stage in stages
                for _ in range(of.randint(0, 3))
            ),
            equipment=tuple(self.equipment() for _ in range(of.randint(0, 8))),
            tables=tables,
            budgets=tuple(self.budget(one) for one in tables if of.random() < 0.5),
            evidence=tuple(
                Evidence(self.text(), self.text(), "3f7a9c0d" * 8, 9, 5, self.day(), self.day(), "0.1.0", stage)
                for stage in stages
            ),
            statements=tuple(self.statement(one) for one in judged),
            effects=tuple(
                Effect(of.choice(names), self.text(), self.text(), self.text(), of.random() < 0.5, self.text())
                for _ in range(of.randint(0, 4))
            ),
            adjustment=self.text() if len(stages) > 1 else "",
            deviations=self.texts(3),
            amends=Amendment("K-0-1", self.day(), self.texts(3) or ("x",), "0" * 64, "K-0", self.day())
            if of.random() < 0.3
            else None,
            next_due=of.choice((None, self.day())),
            remarks=self.texts(2),
            paper=of.choice(("a4", "letter")),
            opinions=self.texts(1),
            notes=self.texts(2),
            holdings=tuple(self.holding(stage) for stage in stages for _ in range(of.randint(0, 3))),
            external=tuple(self.external(of.choice(names)) for _ in range(of.randint(0, 3))),
            supplied=tuple(self.supplied(of.choice((*names, ""))) for _ in range(of.randint(0, 3))),
        )
