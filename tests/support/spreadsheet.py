"""A small evaluator of spreadsheet formulas: numbers, texts, places, ranges and the functions of `FUNCTIONS`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import openpyxl

FUNCTIONS = {
    "IF": lambda test, yes, no: yes() if test() else no(),
    "OR": lambda *each: any(one() for one in each),
    "AND": lambda *each: all(one() for one in each),
    "MAX": lambda *each: max(one() for one in each),
    "MIN": lambda *each: min(one() for one in each),
    "ISNUMBER": lambda one: isinstance(one(), int | float) and not isinstance(one(), bool),
    "INDEX": lambda cells, row, column=lambda: 1: cells()[int(row()) - 1][int(column()) - 1],
}
TOKEN = re.compile(
    r'\s*("[^"]*"|[A-Z]+(?=\()|(?:\w+!)?\$?[A-Z]+\$?\d+(?::\$?[A-Z]+\$?\d+)?|\d+(?:\.\d+)?|<=|>=|<>|[-+*/(),=<>])'
)


class Book:
    """A workbook whose formulas are computed when a cell is asked for."""

    def __init__(self, path: Path) -> None:
        self.sheets = {sheet.title: sheet for sheet in openpyxl.load_workbook(path).worksheets}
        self._known: dict[tuple[str, str], Any] = {}

    def set(self, sheet: str, place: str, value: Any) -> None:
        """Change a cell, after which all are computed again."""
        self.sheets[sheet][place] = value
        self._known.clear()

    def value(self, sheet: str, place: str) -> Any:
        """Return the value of a cell."""
        place = place.replace("$", "")
        if (sheet, place) not in self._known:
            content = self.sheets[sheet][place].value
            formula = isinstance(content, str) and content.startswith("=")
            self._known[sheet, place] = Formula(self, sheet, content[1:]).value() if formula else content
        return self._known[sheet, place]

    def row_of(self, sheet: str, text: str) -> int:
        """Return the row whose first cell has a text."""
        return next(cell.row for cell in self.sheets[sheet]["A"] if cell.value == text)


class Formula:
    """One formula, read by descent: comparison, sum, product, sign, value."""

    def __init__(self, book: Book, sheet: str, text: str) -> None:
        self.book, self.sheet = book, sheet
        self.tokens = TOKEN.findall(text)
        assert "".join(self.tokens) == text.replace(" ", "") or '"' in text, text
        self.at = 0

    def value(self) -> Any:
        """Return the value of the whole formula."""
        result = self._comparison()()
        assert self.at == len(self.tokens)
        return result

    def _next(self) -> str:
        self.at += 1
        return str(self.tokens[self.at - 1])

    def _peek(self) -> str:
        return str(self.tokens[self.at]) if self.at < len(self.tokens) else ""

    def _comparison(self) -> Any:
        left = self._sum()
        if self._peek() in ("=", "<", ">", "<=", ">="):
            sign, right = self._next(), self._sum()
            compare = {
                "=": lambda a, b: a == b, "<": lambda a, b: a < b, ">": lambda a, b: a > b,
                "<=": lambda a, b: a <= b, ">=": lambda a, b: a >= b,
            }[sign]  # fmt: skip
            return lambda: compare(left(), right())
        return left

    def _sum(self) -> Any:
        result = self._product()
        while self._peek() in ("+", "-"):
            sign = 1 if self._next() == "+" else -1
            result = (lambda a, b, s: lambda: a() + s * b())(result, self._product(), sign)
        return result

    def _product(self) -> Any:
        result = self._one()
        while self._peek() == "*":
            self._next()
            result = (lambda a, b: lambda: a() * b())(result, self._one())
        return result

    def _one(self) -> Any:
        token = self._next()
        if token == "-":
            inner = self._one()
            return lambda: -inner()
        if token == "(":
            inner = self._comparison()
            assert self._next() == ")"
            return inner
        if token in FUNCTIONS:
            assert self._next() == "("
            parts = [self._comparison()]
            while self._next() == ",":
                parts.append(self._comparison())
            return lambda: FUNCTIONS[token](*parts)
        if token.startswith('"'):
            return lambda: token[1:-1]
        if token[0].isdigit():
            return lambda: float(token)
        return lambda: self._cells(token)

    def _cells(self, token: str) -> Any:
        sheet, _, place = token.rpartition("!")
        sheet = sheet or self.sheet
        if ":" not in place:
            return self.book.value(sheet, place)
        return [[cell.value for cell in row] for row in self.book.sheets[sheet][place.replace("$", "")]]
