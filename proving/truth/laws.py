"""Laws of physics that are shifted a little: a witness of verdicts that knows no effect of a catalogue.

The equations and the ranges of their variables are those of the AI Feynman benchmark (Udrescu and Tegmark, Science
Advances 6 (2020) eaay2631, table 4). What is declared is the published equation with a free factor and a constant. What
is measured is the same equation with one variable that is not quite what was recorded, in turn: it has an offset of a
part of its range, it has another exponent, or it is not in the declared formula at all.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
ROWS, NOISE = 80, 0.01
"""Rows of a table, and the sd of its noise over that of the response."""
OFFSET, EXPONENT = 0.15, 1.2
"""Offset of a variable as a share of its range, and its exponent, where it is shifted."""

EQUATIONS = """
I.6.2    | exp(-(theta/sigma)^2/2)/sigma            | sigma 1 3, theta 1 3
I.6.2b   | exp(-((theta-theta1)/sigma)^2/2)/sigma   | sigma 1 3, theta 1 3, theta1 1 3
I.8.14   | sqrt((x2-x1)^2+(y2-y1)^2)                | x1 1 5, x2 1 5, y1 1 5, y2 1 5
I.10.7   | m/sqrt(1-v^2/c^2)                        | m 1 5, v 1 2, c 3 10
I.12.1   | mu*Nn                                    | mu 1 5, Nn 1 5
I.12.2   | q1*q2/(epsilon*r^2)                      | q1 1 5, q2 1 5, epsilon 1 5, r 1 5
I.12.4   | q1/(epsilon*r^2)                         | q1 1 5, epsilon 1 5, r 1 5
I.12.11  | q*(Ef+B*v*sin(theta))                    | q 1 5, Ef 1 5, B 1 5, v 1 5, theta 1 5
I.13.4   | m*(v^2+u^2+w^2)                          | m 1 5, v 1 5, u 1 5, w 1 5
I.13.12  | m1*m2*(1/r2-1/r1)                        | m1 1 5, m2 1 5, r1 1 5, r2 1 5
I.14.3   | m*g*z                                    | m 1 5, g 1 5, z 1 5
I.14.4   | k*x^2                                    | k 1 5, x 1 5
I.15.3x  | (x-u*t)/sqrt(1-u^2/c^2)                  | x 5 10, u 1 2, c 3 20, t 1 2
I.15.1   | m*v/sqrt(1-v^2/c^2)                      | m 1 5, v 1 2, c 3 10
I.16.6   | (u+v)/(1+u*v/c^2)                        | c 1 5, v 1 5, u 1 5
I.18.4   | (m1*r1+m2*r2)/(m1+m2)                    | m1 1 5, m2 1 5, r1 1 5, r2 1 5
I.18.12  | r*F*sin(theta)                           | r 1 5, F 1 5, theta 0 5
I.24.6   | m*(omega^2+omega0^2)*x^2                 | m 1 3, omega 1 3, omega0 1 3, x 1 3
I.25.13  | q/C                                      | q 1 5, C 1 5
I.27.6   | 1/(1/d1+n/d2)                            | d1 1 5, d2 1 5, n 1 5
I.29.4   | omega/c                                  | omega 1 10, c 1 10
I.29.16  | sqrt(x1^2+x2^2-2*x1*x2*cos(t1-t2))       | x1 1 5, x2 1 5, t1 1 5, t2 1 5
I.32.5   | q^2*a^2/(epsilon*c^3)                    | q 1 5, a 1 5, epsilon 1 5, c 1 5
I.34.8   | q*v*B/p                                  | q 1 5, v 1 5, B 1 5, p 1 5
I.34.1   | omega/(1-v/c)                            | c 3 10, v 1 2, omega 1 5
I.34.14  | (1+v/c)/sqrt(1-v^2/c^2)*omega            | c 3 10, v 1 2, omega 1 5
I.37.4   | I1+I2+2*sqrt(I1*I2)*cos(delta)           | I1 1 5, I2 1 5, delta 1 5
I.38.12  | epsilon*h^2/(m*q^2)                      | m 1 5, q 1 5, h 1 5, epsilon 1 5
I.39.11  | p*V/(gamma-1)                            | gamma 2 5, p 1 5, V 1 5
I.39.22  | n*T/V                                    | n 1 5, T 1 5, V 1 5
I.40.1   | n*exp(-m*x/T)                            | n 1 5, m 1 5, x 1 5, T 1 5
I.41.16  | omega^3/(c^2*(exp(h*omega/T)-1))         | omega 1 5, T 1 5, h 1 5, c 1 5
I.43.16  | mu*q*V/d                                 | mu 1 5, q 1 5, V 1 5, d 1 5
I.43.31  | mob*T                                    | mob 1 5, T 1 5
I.43.43  | k*v/(A*(gamma-1))                        | gamma 2 5, k 1 5, A 1 5, v 1 5
I.44.4   | n*T*log(V2/V1)                           | n 1 5, T 1 5, V1 1 5, V2 1 5
I.47.23  | sqrt(gamma*p/rho)                        | gamma 1 5, p 1 5, rho 1 5
I.48.2   | m*c^2/sqrt(1-v^2/c^2)                    | m 1 5, v 1 2, c 3 10
I.50.26  | x*(cos(omega*t)+alpha*cos(omega*t)^2)    | x 1 3, omega 1 3, t 1 3, alpha 1 3
II.2.42  | k*(T2-T1)*A/d                            | k 1 5, T1 1 5, T2 1 5, A 1 5, d 1 5
II.3.24  | P/r^2                                    | P 1 5, r 1 5
II.4.23  | q/(epsilon*r)                            | q 1 5, epsilon 1 5, r 1 5
II.6.11  | p*cos(theta)/(epsilon*r^2)               | epsilon 1 3, p 1 3, theta 1 3, r 1 3
II.6.15b | p*cos(theta)*sin(theta)/(epsilon*r^3)    | epsilon 1 3, p 1 3, theta 1 3, r 1 3
II.8.31  | epsilon*E^2                              | epsilon 1 5, E 1 5
II.10.9  | sigma/(epsilon*(1+chi))                  | sigma 1 5, epsilon 1 5, chi 1 5
II.11.3  | q*E/(m*(omega0^2-omega^2))               | q 1 3, E 1 3, m 1 3, omega0 3 5, omega 1 2
II.11.27 | n*alpha/(1-n*alpha/3)*epsilon*E          | n 0 1, alpha 0 1, epsilon 1 2, E 1 2
II.11.28 | n*alpha/(1-n*alpha/3)                    | n 0 1, alpha 0 1
II.13.17 | I/(epsilon*c^2*r)                        | epsilon 1 5, c 1 5, I 1 5, r 1 5
II.15.4  | mom*B*cos(theta)                         | mom 1 5, B 1 5, theta 1 5
II.24.17 | sqrt(omega^2/c^2-9.87/d^2)               | omega 4 6, c 1 2, d 2 4
II.34.2  | q*v*r                                    | q 1 5, v 1 5, r 1 5
II.35.21 | n*mom*(1-2/(1+exp(2*mom*B/T)))           | n 1 5, mom 1 5, B 1 5, T 1 5
II.38.3  | Y*A*x/d                                  | Y 1 5, A 1 5, d 1 5, x 1 5
III.4.33 | h*omega/(exp(h*omega/T)-1)               | h 1 5, omega 1 5, T 1 5
III.8.54 | sin(E*t/h)^2                             | E 1 2, t 1 2, h 1 4
III.10.19| mom*sqrt(Bx^2+By^2+Bz^2)                 | mom 1 5, Bx 1 5, By 1 5, Bz 1 5
III.14.14| I0*(exp(q*V/T)-1)                        | I0 1 5, q 1 2, V 1 2, T 1 2
III.17.37| beta*(1+alpha*cos(theta))                | beta 1 5, alpha 1 5, theta 1 5
"""


@dataclass(frozen=True)
class Law:
    """An equation and what is wrong about it.

    Attributes:
        number: in the benchmark.
        ranges: of its variables, all of which are recorded.
        truth: what is measured, as arithmetic of the variables.
        declared: the formula that a laboratory declares.
        wrong: in words.
    """

    number: str
    ranges: Mapping[str, tuple[float, float]]
    truth: str
    declared: str
    wrong: str


def laws() -> dict[str, Law]:
    """All of them by number; which variable is wrong, and how, goes round."""
    found = {}
    for k, line in enumerate(EQUATIONS.strip().splitlines()):
        number, text, variables = (part.strip() for part in line.split("|"))
        parts = [one.split() for one in variables.split(",")]
        ranges = {name: (float(low), float(high)) for name, low, high in parts}
        name = list(ranges)[k % len(ranges)]
        low, high = ranges[name]
        offset, middle = OFFSET * (high - low), 0.5 * (low + high)
        truth, declared, wrong = (
            (_with(text, name, f"({name}+{offset:.15g})"), text, f"{name} has an offset of {offset:.3g}"),
            (_with(text, name, f"({name}^{EXPONENT:.15g})"), text, f"{name} has the exponent {EXPONENT:g}"),
            (text, _with(text, name, f"{middle:.15g}"), f"{name} is not in the formula"),
        )[k % 3]
        found[number] = Law(number, ranges, truth, f"1 + I({declared})", wrong)
    return found


def drawn(law: Law, seed: int, rows: int = ROWS) -> tuple[dict[str, Floats], Floats, float]:
    """Columns with the response `y`, (n,) the response without noise, and the sd of the noise."""
    rng = np.random.default_rng([41, rows, seed])
    columns = {name: rng.uniform(low, high, rows) for name, (low, high) in law.ranges.items()}
    known: dict[str, Any] = {"exp": np.exp, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "log": np.log, **columns}
    # Our own text above; `^` is the power of formulas.
    true = np.asarray(eval(law.truth.replace("^", "**"), {"__builtins__": {}}, known), np.float64)
    sd = NOISE * float(np.std(true))
    return {**columns, "y": true + sd * rng.standard_normal(rows)}, true, sd


def _with(text: str, name: str, other: str) -> str:
    return re.sub(rf"\b{name}\b", other, text)
