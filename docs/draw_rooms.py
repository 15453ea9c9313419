"""Draw the rooms of the three packages and who imports whom, from the code itself: `python docs/draw_rooms.py`.

The order of rooms is that of `docs/rooms.toml`. An arrow is an import of one room by another; arrows that follow from
others (a uses b, b uses c, so a may use c) are left out, and so are those to the first row, which every room may use.
"""

from __future__ import annotations

import ast
import tomllib
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "rooms.svg"
ROOMS: dict[str, list[list[str]]] = tomllib.loads((ROOT / "docs" / "rooms.toml").read_text(encoding="utf-8"))
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in ROOMS
    for path in sorted((ROOT / package).rglob("*.py"))
}
COLUMN, BOX, ROW, TOP = 350, 232, 44, 64
"""Widths of a column and of a box, height of a row, and where the first row begins, in units of the drawing."""
INK, SOFT, FILL = "#1b2430", "#6b7684", "#eef3f8"


def room_of(module: str) -> str | None:
    """Return "package.room" of a module, None for the face of a package."""
    package, _, inner = module.partition(".")
    known = {room for row in ROOMS[package] for room in row}
    parts = inner.split(".")
    return next((f"{package}.{room}" for n in range(len(parts), 0, -1) if (room := ".".join(parts[:n])) in known), None)


@cache
def imports() -> dict[str, set[str]]:
    """Return room -> rooms that its files import."""
    used: dict[str, set[str]] = {
        f"{package}.{room}": set() for package in ROOMS for row in ROOMS[package] for room in row
    }
    for module, path in MODULES.items():
        room = room_of(module)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if room is None or not isinstance(node, ast.ImportFrom) or node.module not in MODULES:
                continue
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                other = room_of(inner if inner in MODULES else node.module)
                if other is not None and other != room:
                    used[room].add(other)
    return used


def boxes(package: str) -> list[tuple[str, list[str]]]:
    """Return the boxes of a package from its commands down to its base: a title, and the rooms that it holds."""
    first, *others = ROOMS[package]
    drawn = [(room, [f"{package}.{room}"]) for row in others for room in row]
    return [*reversed(drawn), (", ".join(first), [f"{package}.{room}" for room in first])]


def reduced(package: str) -> list[tuple[int, int]]:
    """Return arrows between boxes of a package, by position, without those that follow from others."""
    listed = boxes(package)
    place = {room: number for number, (_, rooms) in enumerate(listed) for room in rooms}
    last = len(listed) - 1
    used = {
        number: {place[other] for room in rooms for other in imports()[room] if other in place} - {number, last}
        for number, (_, rooms) in enumerate(listed)
    }

    def reach(number: int) -> set[int]:
        return used[number].union(*(reach(other) for other in used[number]))

    return [
        (number, other)
        for number in used
        for other in sorted(used[number])
        if not any(other in reach(middle) for middle in used[number] - {other})
    ]


def elsewhere(package: str, rooms: list[str]) -> str:
    """Return which rooms of other packages a box imports, as one line."""
    used = {other for room in rooms for other in imports()[room] if not other.startswith(f"{package}.")}
    bases = {f"{other}.{room}" for other in ROOMS for room in ROOMS[other][0]}
    named = sorted(used - bases, reverse=True)
    return "uses " + ", ".join(named) if named else ""


def draw() -> str:
    """Return the picture as SVG."""
    height = TOP + ROW * max(len(boxes(package)) for package in ROOMS) + 24
    width = COLUMN * len(ROOMS)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
        f'role="img" aria-label="Rooms of reba, dreba and lgp and their imports">',
        '<defs><marker id="end" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 L8 4 L0 8 z" fill="{SOFT}"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for column, package in enumerate(ROOMS):
        left = 10 + column * COLUMN
        files = sum(name.split(".")[0] == package for name in MODULES)
        parts.append(
            f'<text x="{left}" y="30" font-size="20" font-weight="bold" fill="{INK}">{package}</text>'
            f'<text x="{left}" y="48" font-size="12" fill="{SOFT}">{files} files</text>'
        )
        for start, end in reduced(package):
            y1, y2 = (TOP + number * ROW + 18 for number in (start, end))
            reach = left + BOX + 14 + min(11 * (end - start), 88)
            parts.append(
                f'<path d="M{left + BOX} {y1 + 4} C{reach} {y1 + 4} {reach} {y2 - 4} {left + BOX + 2} {y2 - 4}" '
                f'fill="none" stroke="{SOFT}" marker-end="url(#end)"/>'
            )
        for number, (title, rooms) in enumerate(boxes(package)):
            y = TOP + number * ROW
            used = elsewhere(package, rooms)
            parts.append(
                f'<rect x="{left}" y="{y}" width="{BOX}" height="36" rx="5" fill="{FILL}" stroke="{SOFT}"/>'
                f'<text x="{left + 8}" y="{y + (15 if used else 22)}" font-size="{13 if len(title) < 30 else 7.5}" '
                f'fill="{INK}">{escape(title)}</text>'
            )
            if used:
                shown = used if len(used) <= 52 else used[:51].rsplit(",", 1)[0] + ", …"
                parts.append(f'<text x="{left + 8}" y="{y + 29}" font-size="8" fill="{SOFT}">{escape(shown)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")
