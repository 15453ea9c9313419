"""Terminal tables of the `lgp` commands."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from reba.terminal import Console, Text


def show_plan(console: Console, summary: dict[str, Any]) -> None:
    """Print a plan: actions with the mean REBA score of each phase, costs, residuals and search statistics."""
    if not summary["actions"]:
        console.print(f"{summary['scene']}: the goal holds already; no action is needed")
        return
    table = Table(title=f"Plan for {summary['scene']}", title_justify="left", header_style="bold")
    table.add_column("action")
    table.add_column("mean REBA", justify="right")
    scores = summary["reba"]["per_phase"] or [None] * len(summary["actions"])
    for action, score in zip(summary["actions"], scores, strict=True):
        table.add_row(Text(action), "-" if score is None else f"{score:.1f}")
    console.print(table)
    cost, residuals, search = summary["cost"], summary["residuals"], summary["search"]
    console.print(
        f"cost {cost['total']:.3f}: acceleration {cost['acceleration']:.3f}, ergonomics {cost['ergonomics']:.3f}; "
        f"constraints are satisfied within {residuals['metres']:.1e} m and {residuals['radians']:.1e} rad"
    )
    if residuals.get("penetration"):
        console.print(f"deepest penetration of two bodies: {residuals['penetration']:.3f} m")
    if summary["reba"]["mean"] is not None:
        console.print(f"REBA: mean {summary['reba']['mean']:.2f}, max {summary['reba']['max']}")
    best = {
        "optimal": "no other sequence within the depth costs less",
        "given": "no other sequence was planned",
    }.get(summary["status"], f"the optimum within the depth may cost up to {search['gap']:.1%} less")
    console.print(
        f"search: {search['poses']} poses, {search['sequences']} sequences, {search['paths']} paths in "
        f"{search['seconds']:.1f} s; {best}"
    )


def show_toolbox(console: Console, summary: dict[str, Any]) -> None:
    """Print both sequences of the toolbox experiment beside the paper's, the cost of each order and REBA scores."""
    for name, one in summary["conditions"].items():
        table = Table(title=f"{name}: {one['order']}", title_justify="left", header_style="bold")
        table.add_column("ours")
        table.add_column("the paper's")
        for ours, theirs in zip(one["actions"], one["published_actions"], strict=False):
            table.add_row(Text(ours.replace("toolbox/", "")), Text(theirs.replace("toolbox/", "")))
        console.print(table)
        for order, cost in one["orders"].items():
            kinds = (key for key in cost if key.startswith("acceleration of") or key in ("posture", "load"))
            console.print(
                f"  {order}: cost {cost['total']:.3f} (" + ", ".join(f"{k} {cost[k]:.3f}" for k in kinds) + ")"
            )
        mass = one["first_part"]["mass_for_place_first"]
        if mass is not None:
            first = one["first_part"]
            console.print(
                f"  placing {first['name']} first costs less from {mass:.2f} kg on; its mass is {first['mass']:.2f} kg"
            )
        parts = ", ".join(f"{part} {value:.2f}" for part, value in one["parts"].items())
        console.print(f"  true REBA: mean {one['reba']['mean']:.2f}, highest {one['reba']['max']:.0f}; {parts}")
