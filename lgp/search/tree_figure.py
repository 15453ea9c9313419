"""The search tree as SVG (Fig. 4 of the paper): one box per sequence, with its costs or the reason of its verdict."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Final

from lgp.search.records import Node
from reba.printable import as_markup

BOX: Final = (300, 78)
"""Width and height of a box [px]."""
GAP: Final = (60, 18)
"""Space between boxes [px]: across depths, along one."""
STYLES: Final[dict[str, tuple[str, str]]] = {
    "best": ("#e7f4ea", "#1b7837"),
    "": ("#ffffff", "#666666"),
    "infeasible": ("#fbe9e7", "#b2182b"),
    "pruned": ("#f0f0f0", "#999999"),
    "over budget": ("#fff8e1", "#b8860b"),
}
"""Verdict -> fill and line colours."""
LINE: Final = 54
"""Characters per line that fit into a box."""
ROWS: Final = 3
"""Lines of details that fit into a box; the tooltip shows all."""
LEGEND: Final = (("best", "the plan"), ("", "examined or still open"), ("infeasible", "cannot be done"),
              ("pruned", "cannot be the best"), ("over budget", "left when the budget ran out"))  # fmt: skip


def draw(nodes: Sequence[Node], best: Sequence[object] = ()) -> str:
    """Return the tree as SVG text; the path to the plan `best` is drawn thick. Parents come before children.

    >>> draw([Node(0, -1, None, (), 0, False)]).startswith("<svg")
    True
    """
    places = _places(nodes)
    foot = max((y for _, y in places.values()), default=0) + BOX[1] + GAP[1]
    verdicts = {"best", *(node.verdict for node in nodes)}
    legend, legend_width = _legend([entry for entry in LEGEND if entry[0] in verdicts], foot)
    height = foot + GAP[1] + 16
    width = max(max((x for x, _ in places.values()), default=0) + BOX[0] + GAP[1], legend_width)
    on_plan = {node.number for node in nodes if best and node.skeleton == tuple(best)[: len(node.skeleton)]}
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="sans-serif" role="img"><title>Searched sequences of actions</title>'
    ]
    for node in nodes:
        if node.parent in places:
            parts.append(_edge(places[node.parent], places[node.number], node.number in on_plan, node.verdict))
    parts += [_box(node, places[node.number], node.number in on_plan) for node in nodes]
    return "\n".join([*parts, *legend, "</svg>"]) + "\n"


def _legend(entries: Sequence[tuple[str, str]], y: float) -> tuple[list[str], float]:
    """Return the legend of the colours as a row at height y, and its width [px]."""
    parts, x = [], float(GAP[1])
    for verdict, words in entries:
        fill, line = STYLES[verdict]
        parts.append(f'<path d="M {x:g} {y:g} h 18 v 12 h -18 z" fill="{fill}" stroke="{line}"/>')
        parts.append(f'<text x="{x + 25:g}" y="{y + 10.5:g}" font-size="11.5" fill="#333">{as_markup(words)}</text>')
        x += 45 + 6.3 * len(words)
    return parts, x


def _places(nodes: Sequence[Node]) -> dict[int, tuple[float, float]]:
    """Return the corner of each box [px]: depth to the right, leaves in rows, parents centred at their children."""
    children: dict[int, list[int]] = {}
    for node in nodes:
        children.setdefault(node.parent, []).append(node.number)
    rows: dict[int, float] = {}
    leaves = 0
    # An explicit stack: trees may be deeper than the recursion limit.
    stack = [(number, False) for number in reversed(children.get(-1, []))]
    while stack:
        number, seen = stack.pop()
        below = children.get(number, [])
        if not below:
            rows[number], leaves = float(leaves), leaves + 1
        elif seen:
            rows[number] = sum(rows[child] for child in below) / len(below)
        else:
            stack += [(number, True), *((child, False) for child in reversed(below))]
    return {
        node.number: (
            GAP[1] + len(node.skeleton) * (BOX[0] + GAP[0]),
            GAP[1] + rows[node.number] * (BOX[1] + GAP[1]),
        )
        for node in nodes
    }


def _edge(parent: tuple[float, float], child: tuple[float, float], thick: bool, verdict: str) -> str:
    x, y = parent[0] + BOX[0], parent[1] + BOX[1] / 2
    end = child[1] + BOX[1] / 2
    middle = (x + child[0]) / 2
    _, line = STYLES["best" if thick else verdict]
    dashes = ' stroke-dasharray="5 4"' if verdict in ("infeasible", "pruned") else ""
    return (
        f'<path d="M {x:g} {y:g} C {middle:g} {y:g} {middle:g} {end:g} {child[0]:g} {end:g}" fill="none" '
        f'stroke="{line}" stroke-width="{3 if thick else 1.2}"{dashes}/>'
    )


def _box(node: Node, at: tuple[float, float], thick: bool) -> str:
    fill, line = STYLES["best" if thick else node.verdict]
    title = str(node.action.at(len(node.skeleton))) if node.action is not None else "start"
    costs = ", ".join(f"{level} {cost:.4g}" for level, cost in node.costs.items())
    small = ([f"cost: {costs}"] if costs else []) + textwrap.wrap(_reason(node), LINE)
    if len(small) > ROWS:
        small = [*small[: ROWS - 1], small[ROWS - 1][: LINE - 3] + "..."]
    texts = [
        f'<text x="{at[0] + 8:g}" y="{at[1] + 20:g}" font-size="12.5" font-weight="bold">{as_markup(title)}</text>',
        *(
            f'<text x="{at[0] + 8:g}" y="{at[1] + 37 + 14 * row:g}" font-size="10.5" fill="#333">{words}</text>'
            for row, words in enumerate(map(as_markup, small))
        ),
    ]
    tooltip = as_markup(" - ".join(part for part in (title, node.verdict, node.reason, costs) if part))
    return (
        f'<g><title>{tooltip}</title><rect x="{at[0]:g}" y="{at[1]:g}" width="{BOX[0]}" height="{BOX[1]}" rx="6" '
        f'fill="{fill}" stroke="{line}" stroke-width="{2.5 if thick else 1.2}"/>{"".join(texts)}</g>'
    )


def _reason(node: Node) -> str:
    """Return the reason without the action, which is the title of the box."""
    step = f"phase {len(node.skeleton)}, {node.action.at(len(node.skeleton))}: " if node.action is not None else ""
    return node.reason.removeprefix(step)
