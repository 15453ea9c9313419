"""Problems of Hock & Schittkowski, Test Examples for Nonlinear Programming Codes (1981), with analytic derivatives.

Numbers, starts and optima are the book's; its constraints g(x) >= 0 are written here as -g(x) <= 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.sqp.problem import FunctionProblem

INF = np.inf
ROOT2, ROOT3 = np.sqrt(2.0), np.sqrt(3.0)


@dataclass(frozen=True)
class Case:
    """One problem with its start and its optimal cost."""

    number: int
    start: list[float]
    optimum: float
    problem: FunctionProblem


def case(number, start, optimum, cost, gradient, lower=None, upper=None, eq=None, eq_jac=None, ineq=None, in_jac=None):
    """Build a case; the callables take the entries of x one by one and return plain lists."""

    def unpacked(function):
        return None if function is None else (lambda x: np.array(function(*x), dtype=float))

    problem = FunctionProblem(
        len(start),
        cost=lambda x: cost(*x),
        gradient=unpacked(gradient),
        lower=lower,
        upper=upper,
        equality=unpacked(eq),
        equality_jacobian=unpacked(eq_jac),
        inequality=unpacked(ineq),
        inequality_jacobian=unpacked(in_jac),
    )
    return Case(number, start, optimum, problem)


def rosenbrock(a, b):
    return 100 * (b - a * a) ** 2 + (1 - a) ** 2


def rosenbrock_gradient(a, b):
    return [-400 * a * (b - a * a) - 2 * (1 - a), 200 * (b - a * a)]


CASES = [
    case(1, [-2, 1], 0.0, rosenbrock, rosenbrock_gradient, lower=[-INF, -1.5]),
    case(
        3,
        [10, 1],
        0.0,
        lambda a, b: b + 1e-5 * (b - a) ** 2,
        lambda a, b: [-2e-5 * (b - a), 1 + 2e-5 * (b - a)],
        lower=[-INF, 0],
    ),
    case(4, [1.125, 0.125], 8 / 3, lambda a, b: (a + 1) ** 3 / 3 + b, lambda a, b: [(a + 1) ** 2, 1], lower=[1, 0]),
    case(
        5,
        [0, 0],
        -ROOT3 / 2 - np.pi / 3,
        lambda a, b: np.sin(a + b) + (a - b) ** 2 - 1.5 * a + 2.5 * b + 1,
        lambda a, b: [np.cos(a + b) + 2 * (a - b) - 1.5, np.cos(a + b) - 2 * (a - b) + 2.5],
        lower=[-1.5, -3],
        upper=[4, 3],
    ),
    case(
        6,
        [-1.2, 1],
        0.0,
        lambda a, b: (1 - a) ** 2,
        lambda a, b: [-2 * (1 - a), 0],
        eq=lambda a, b: [10 * (b - a * a)],
        eq_jac=lambda a, b: [[-20 * a, 10]],
    ),
    case(
        7,
        [2, 2],
        -ROOT3,
        lambda a, b: np.log(1 + a * a) - b,
        lambda a, b: [2 * a / (1 + a * a), -1],
        eq=lambda a, b: [(1 + a * a) ** 2 + b * b - 4],
        eq_jac=lambda a, b: [[4 * a * (1 + a * a), 2 * b]],
    ),
    case(
        8,
        [2, 1],
        -1.0,
        lambda a, b: -1.0,
        lambda a, b: [0, 0],
        eq=lambda a, b: [a * a + b * b - 25, a * b - 9],
        eq_jac=lambda a, b: [[2 * a, 2 * b], [b, a]],
    ),
    case(
        9,
        [0, 0],
        -0.5,
        lambda a, b: np.sin(np.pi * a / 12) * np.cos(np.pi * b / 16),
        lambda a, b: [
            np.pi / 12 * np.cos(np.pi * a / 12) * np.cos(np.pi * b / 16),
            -np.pi / 16 * np.sin(np.pi * a / 12) * np.sin(np.pi * b / 16),
        ],
        eq=lambda a, b: [4 * a - 3 * b],
        eq_jac=lambda a, b: [[4, -3]],
    ),
    case(
        10,
        [-10, 10],
        -1.0,
        lambda a, b: a - b,
        lambda a, b: [1, -1],
        ineq=lambda a, b: [3 * a * a - 2 * a * b + b * b - 1],
        in_jac=lambda a, b: [[6 * a - 2 * b, -2 * a + 2 * b]],
    ),
    case(
        11,
        [4.9, 0.1],
        -8.498464223,
        lambda a, b: (a - 5) ** 2 + b * b - 25,
        lambda a, b: [2 * (a - 5), 2 * b],
        ineq=lambda a, b: [a * a - b],
        in_jac=lambda a, b: [[2 * a, -1]],
    ),
    case(
        12,
        [0, 0],
        -30.0,
        lambda a, b: 0.5 * a * a + b * b - a * b - 7 * a - 7 * b,
        lambda a, b: [a - b - 7, 2 * b - a - 7],
        ineq=lambda a, b: [4 * a * a + b * b - 25],
        in_jac=lambda a, b: [[8 * a, 2 * b]],
    ),
    case(
        14,
        [2, 2],
        9 - 2.875 * np.sqrt(7),
        lambda a, b: (a - 2) ** 2 + (b - 1) ** 2,
        lambda a, b: [2 * (a - 2), 2 * (b - 1)],
        eq=lambda a, b: [a - 2 * b + 1],
        eq_jac=lambda a, b: [[1, -2]],
        ineq=lambda a, b: [0.25 * a * a + b * b - 1],
        in_jac=lambda a, b: [[0.5 * a, 2 * b]],
    ),
    case(
        15,
        [-2, 1],
        306.5,
        rosenbrock,
        rosenbrock_gradient,
        upper=[0.5, INF],
        ineq=lambda a, b: [1 - a * b, -a - b * b],
        in_jac=lambda a, b: [[-b, -a], [-1, -2 * b]],
    ),
    case(
        21,
        [-1, -1],
        -99.96,
        lambda a, b: 0.01 * a * a + b * b - 100,
        lambda a, b: [0.02 * a, 2 * b],
        lower=[2, -50],
        upper=[50, 50],
        ineq=lambda a, b: [10 - 10 * a + b],
        in_jac=lambda a, b: [[-10, 1]],
    ),
    case(
        22,
        [2, 2],
        1.0,
        lambda a, b: (a - 2) ** 2 + (b - 1) ** 2,
        lambda a, b: [2 * (a - 2), 2 * (b - 1)],
        ineq=lambda a, b: [a + b - 2, a * a - b],
        in_jac=lambda a, b: [[1, 1], [2 * a, -1]],
    ),
    case(
        24,
        [1, 0.5],
        -1.0,
        lambda a, b: ((a - 3) ** 2 - 9) * b**3 / (27 * ROOT3),
        lambda a, b: [2 * (a - 3) * b**3 / (27 * ROOT3), ((a - 3) ** 2 - 9) * b * b / (9 * ROOT3)],
        lower=[0, 0],
        ineq=lambda a, b: [b - a / ROOT3, -a - ROOT3 * b, a + ROOT3 * b - 6],
        in_jac=lambda a, b: [[-1 / ROOT3, 1], [-1, -ROOT3], [1, ROOT3]],
    ),
    case(
        26,
        [-2.6, 2, 2],
        0.0,
        lambda a, b, c: (a - b) ** 2 + (b - c) ** 4,
        lambda a, b, c: [2 * (a - b), -2 * (a - b) + 4 * (b - c) ** 3, -4 * (b - c) ** 3],
        eq=lambda a, b, c: [(1 + b * b) * a + c**4 - 3],
        eq_jac=lambda a, b, c: [[1 + b * b, 2 * a * b, 4 * c**3]],
    ),
    case(
        28,
        [-4, 1, 1],
        0.0,
        lambda a, b, c: (a + b) ** 2 + (b + c) ** 2,
        lambda a, b, c: [2 * (a + b), 2 * (a + b) + 2 * (b + c), 2 * (b + c)],
        eq=lambda a, b, c: [a + 2 * b + 3 * c - 1],
        eq_jac=lambda a, b, c: [[1, 2, 3]],
    ),
    case(
        35,
        [0.5, 0.5, 0.5],
        1 / 9,
        lambda a, b, c: 9 - 8 * a - 6 * b - 4 * c + 2 * a * a + 2 * b * b + c * c + 2 * a * b + 2 * a * c,
        lambda a, b, c: [-8 + 4 * a + 2 * b + 2 * c, -6 + 4 * b + 2 * a, -4 + 2 * c + 2 * a],
        lower=[0, 0, 0],
        ineq=lambda a, b, c: [a + b + 2 * c - 3],
        in_jac=lambda a, b, c: [[1, 1, 2]],
    ),
    case(
        39,
        [2, 2, 2, 2],
        -1.0,
        lambda a, b, c, d: -a,
        lambda a, b, c, d: [-1, 0, 0, 0],
        eq=lambda a, b, c, d: [b - a**3 - c * c, a * a - b - d * d],
        eq_jac=lambda a, b, c, d: [[-3 * a * a, 1, -2 * c, 0], [2 * a, -1, 0, -2 * d]],
    ),
    case(
        40,
        [0.8, 0.8, 0.8, 0.8],
        -0.25,
        lambda a, b, c, d: -a * b * c * d,
        lambda a, b, c, d: [-b * c * d, -a * c * d, -a * b * d, -a * b * c],
        eq=lambda a, b, c, d: [a**3 + b * b - 1, a * a * d - c, d * d - b],
        eq_jac=lambda a, b, c, d: [[3 * a * a, 2 * b, 0, 0], [2 * a * d, 0, -1, a * a], [0, -1, 0, 2 * d]],
    ),
    case(
        43,
        [0, 0, 0, 0],
        -44.0,
        lambda a, b, c, d: a * a + b * b + 2 * c * c + d * d - 5 * a - 5 * b - 21 * c + 7 * d,
        lambda a, b, c, d: [2 * a - 5, 2 * b - 5, 4 * c - 21, 2 * d + 7],
        ineq=lambda a, b, c, d: [
            a * a + b * b + c * c + d * d + a - b + c - d - 8,
            a * a + 2 * b * b + c * c + 2 * d * d - a - d - 10,
            2 * a * a + b * b + c * c + 2 * a - b - d - 5,
        ],
        in_jac=lambda a, b, c, d: [
            [2 * a + 1, 2 * b - 1, 2 * c + 1, 2 * d - 1],
            [2 * a - 1, 4 * b, 2 * c, 4 * d - 1],
            [4 * a + 2, 2 * b - 1, 2 * c, -1],
        ],
    ),
    case(
        48,
        [3, 5, -3, 2, -2],
        0.0,
        lambda a, b, c, d, e: (a - 1) ** 2 + (b - c) ** 2 + (d - e) ** 2,
        lambda a, b, c, d, e: [2 * (a - 1), 2 * (b - c), -2 * (b - c), 2 * (d - e), -2 * (d - e)],
        eq=lambda a, b, c, d, e: [a + b + c + d + e - 5, c - 2 * (d + e) + 3],
        eq_jac=lambda a, b, c, d, e: [[1, 1, 1, 1, 1], [0, 0, 1, -2, -2]],
    ),
    case(
        71,
        [1, 5, 5, 1],
        17.0140173,
        lambda a, b, c, d: a * d * (a + b + c) + c,
        lambda a, b, c, d: [d * (2 * a + b + c), a * d, a * d + 1, a * (a + b + c)],
        lower=[1, 1, 1, 1],
        upper=[5, 5, 5, 5],
        eq=lambda a, b, c, d: [a * a + b * b + c * c + d * d - 40],
        eq_jac=lambda a, b, c, d: [[2 * a, 2 * b, 2 * c, 2 * d]],
        ineq=lambda a, b, c, d: [25 - a * b * c * d],
        in_jac=lambda a, b, c, d: [[-b * c * d, -a * c * d, -a * b * d, -a * b * c]],
    ),
    case(
        76,
        [0.5, 0.5, 0.5, 0.5],
        -4.681818181,
        lambda a, b, c, d: a * a + b * b / 2 + c * c + d * d / 2 - a * c + c * d - a - 3 * b + c - d,
        lambda a, b, c, d: [2 * a - c - 1, b - 3, 2 * c - a + d + 1, d + c - 1],
        lower=[0, 0, 0, 0],
        ineq=lambda a, b, c, d: [a + 2 * b + c + d - 5, 3 * a + b + 2 * c - d - 4, 1.5 - b - 4 * c],
        in_jac=lambda a, b, c, d: [[1, 2, 1, 1], [3, 1, 2, -1], [0, -1, -4, 0]],
    ),
    case(
        77,
        [2, 2, 2, 2, 2],
        0.24150513,
        lambda a, b, c, d, e: (a - 1) ** 2 + (a - b) ** 2 + (c - 1) ** 2 + (d - 1) ** 4 + (e - 1) ** 6,
        lambda a, b, c, d, e: [
            2 * (a - 1) + 2 * (a - b),
            -2 * (a - b),
            2 * (c - 1),
            4 * (d - 1) ** 3,
            6 * (e - 1) ** 5,
        ],
        eq=lambda a, b, c, d, e: [a * a * d + np.sin(d - e) - 2 * ROOT2, b + c**4 * d * d - 8 - ROOT2],
        eq_jac=lambda a, b, c, d, e: [
            [2 * a * d, 0, 0, a * a + np.cos(d - e), -np.cos(d - e)],
            [0, 1, 4 * c**3 * d * d, 2 * c**4 * d, 0],
        ],
    ),
    case(
        78,
        [-2, 1.5, 2, -1, -1],
        -2.91970041,
        lambda a, b, c, d, e: a * b * c * d * e,
        lambda a, b, c, d, e: [b * c * d * e, a * c * d * e, a * b * d * e, a * b * c * e, a * b * c * d],
        eq=lambda a, b, c, d, e: [
            a * a + b * b + c * c + d * d + e * e - 10,
            b * c - 5 * d * e,
            a**3 + b**3 + 1,
        ],
        eq_jac=lambda a, b, c, d, e: [
            [2 * a, 2 * b, 2 * c, 2 * d, 2 * e],
            [0, c, b, -5 * e, -5 * d],
            [3 * a * a, 3 * b * b, 0, 0, 0],
        ],
    ),
]
