"""Labels, colours and explanations of the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from reba.method.tables import ACTION_LEVELS, LEVEL_OF
from reba.posture.columns import COLUMNS_OF, SIDES
from reba.posture.columns import PARTS as BODY_PARTS

LEVEL_COLOURS: Final[tuple[str, ...]] = ("#5aa5d6", "#bfe0ef", "#ffe8a3", "#f9a35c", "#b92d2b")
"""Action levels 0 to 4: blue over yellow to red after ColorBrewer RdYlBu, which colour-blind people can distinguish;
the name of a level is always printed with its colour."""
PART_COLOURS: Final[tuple[str, ...]] = ("#eef0f6", "#e3e1f1", "#c3bfe2", "#9e95ce", "#7a68b5", "#5c3c99", "#3f1273")
"""Part scores 0 to 6: one hue, light to dark."""
TEXT_ON: Final[dict[str, str]] = dict.fromkeys((LEVEL_COLOURS[4], *PART_COLOURS[4:]), "#ffffff")
"""Text colour on the dark ones of these colours; dark text on all others."""
PARTS: Final[dict[str, str]] = {
    "trunk": "Trunk",
    "neck": "Neck",
    "legs": "Legs",
    "load_force": "Load and force",
    "upper_arm_left": "Left upper arm",
    "upper_arm_right": "Right upper arm",
    "lower_arm_left": "Left lower arm",
    "lower_arm_right": "Right lower arm",
    "wrist_left": "Left wrist",
    "wrist_right": "Right wrist",
    "coupling_left": "Left coupling",
    "coupling_right": "Right coupling",
    "activity": "Activity",
}
"""Part score columns in worksheet order, with their titles."""
BODY: Final[dict[str, str]] = {
    "trunk": "the trunk",
    "neck": "the neck",
    "legs": "the knees",
    "upper_arm": "the upper arms",
    "lower_arm": "the elbows",
    "wrist": "the wrists",
}
"""Body part -> its name in a sentence."""
RULES: Final[dict[str, str]] = {
    "name": "name of the rules",
    "trunk_upright": "trunk counts as upright up to this flexion or extension [deg]",
    "neck_upright": "neck is not in extension up to this angle [deg]",
    "trunk_twist": "trunk is twisted above [deg]",
    "trunk_side_bend": "trunk is side flexed above [deg]",
    "neck_twist": "neck is twisted above [deg]",
    "neck_side_bend": "neck is side flexed above [deg]",
    "abduction": "upper arm is abducted above [deg]",
    "shoulder_elevation": "shoulder is raised above [deg]",
    "wrist_deviation": "wrist is bent from the midline above [deg]",
    "wrist_twist": "wrist is twisted above [deg]",
    "edges": "class that an angle on a printed edge belongs to",
    "twist_and_bend": "points for twisted and side flexed together",
    "upper_arm_reference": "what upper arm angles are measured against",
    "two_sides": "arm that gives the total",
    "seated_knees": "bent knees count while sitting",
    "walking_legs": "leg score while walking",
    "coupling_without_load": "coupling counts without a load",
    "static_seconds": "a part is static if held for longer than [s]",
    "static_range": "... with all its angles within a band of [deg]",
    "repeated_per_minute": "an action is repeated above this number of movements per minute",
    "repeated_min": "... smallest amplitude that counts [deg]",
    "repeated_max": "... largest amplitude that counts [deg]",
    "gait_per_minute": "strides per minute from which an interval counts as walking",
    "rapid_range": "a change of posture is rapid and large above [deg]",
    "rapid_seconds": "... within [s]",
}
"""Field of `reba.Rules` -> its meaning."""
FACTORS: Final[dict[str, str]] = {
    "load": "Load [kg]",
    "shock": "Shock or rapid force",
    "coupling_left": "Coupling, left hand",
    "coupling_right": "Coupling, right hand",
    "support": "Leg support",
    "arm_supported_left": "Left arm supported",
    "arm_supported_right": "Right arm supported",
    "static": "Activity: static",
    "repeated": "Activity: repeated",
    "unstable": "Activity: rapid or unstable",
}
"""Factor -> its title."""
SOURCES: Final[tuple[str, ...]] = (
    "Hignett S, McAtamney L (2000). Rapid Entire Body Assessment (REBA). Applied Ergonomics 31:201-205.",
    "Hignett S, McAtamney L (2005). Rapid Entire Body Assessment. In: Handbook of Human Factors and Ergonomics "
    "Methods, chapter 8.",
    "Hignett S. REBA. In: Fundamentals and Assessment Tools for Occupational Ergonomics, chapter 42, Table 42.2.",
)
"""Where the method is published."""
LIMITS: Final[tuple[str, ...]] = (
    "REBA was made for selected postures that a trained observer rates. Scoring every frame of a recording is a "
    "screening: it shows where to look, and does not replace the judgement of an ergonomist at the workplace.",
    "The score rates posture, load, grip and activity of single moments. It does not include the duration of the "
    "working day, recovery, vibration, temperature or mental load.",
    "The report makes no medical statement about a person, and a score does not measure injury.",
    "Angles contain the errors of the sensor or the body model; a posture close to a class edge can be scored on "
    "either side of it. The edges used are listed under Assumptions.",
)
"""Limits of the method that a reader must know before using the figures."""


def risk(low: int | None, high: int | None) -> str:
    """Return the risk of a score or a range of scores as text: "high", "medium to very high"."""
    if low is None or high is None:
        return "not known"
    first, second = ACTION_LEVELS[LEVEL_OF[low]][0], ACTION_LEVELS[LEVEL_OF[high]][0]
    return first if first == second else f"{first} to {second}"


def action(level: int) -> str:
    """Return the action of an action level as text: "no action necessary", "action necessary soon"."""
    urgency = ACTION_LEVELS[level][1]
    return f"no action {urgency.removeprefix('none ')}" if urgency.startswith("none ") else f"action {urgency}"


def angle_name(column: str) -> str:
    """Return the name of an angle column in a sentence.

    >>> angle_name("wrist_flexion_left")
    'left wrist flexion'
    """
    for side in SIDES:
        if column.endswith(f"_{side}"):
            return f"{side} {column.removesuffix(f'_{side}')}".replace("_", " ").replace("lower arm", "elbow")
    return column.replace("_", " ")


def body_parts(columns: Sequence[str]) -> list[str]:
    """Return the names of angle columns in a sentence; a complete part or both sides are one name.

    >>> body_parts(["neck_twist", "knee_flexion_left", "knee_flexion_right"])
    ['neck twist', 'the knees']
    """
    names = []
    for part, angles in BODY_PARTS.items():
        every = [column for name in angles for column in COLUMNS_OF[name]]
        if all(column in columns for column in every):
            names.append(BODY[part])
            continue
        for name in angles:
            if all(column in columns for column in COLUMNS_OF[name]):
                names.append(name.replace("_", " "))
            else:
                names += [angle_name(column) for column in COLUMNS_OF[name] if column in columns]
    return names
