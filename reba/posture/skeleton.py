"""A person drawn from posture angles: 3D joint centres, three views, one SVG.

The trunk's frame and the direction of the upper arm follow `reba.posture.angles`: x forward, y up, z to the right. What
the angles leave open is drawn plainly: hips and ankles so that the feet stay below the body, unmeasured limbs in their
neutral place as grey dashes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from reba.arrays import Array
from reba.posture.columns import INDEX, SIDES
from reba.printable import as_markup

LENGTHS: Final[dict[str, float]] = {
    "shank": 0.246, "thigh": 0.245, "trunk": 0.288, "neck": 0.06, "head": 0.13, "upper_arm": 0.186, "forearm": 0.146,
    "hand": 0.09, "shoulders": 0.215, "hips": 0.17,
}  # fmt: skip
"""Segment lengths as shares of stature, rounded from Drillis & Contini (1966) in Winter, Biomechanics, fig. 4.1."""
NEUTRAL: Final = np.array([80.0 if name.startswith("lower_arm") else 0.0 for name in INDEX])
"""[deg] Where an unmeasured limb is drawn."""
LIMBS: Final[dict[str, tuple[str, str, str]]] = {
    "trunk": ("hip", "neck", "trunk_flexion"),
    "neck": ("neck", "head", "neck_flexion"),
    **{
        f"{part}_{side}": (f"{a}_{side}", f"{b}_{side}", f"{angle}_{side}")
        for side in SIDES
        for part, a, b, angle in (
            ("thigh", "hip", "knee", "knee_flexion"),
            ("shank", "knee", "ankle", "knee_flexion"),
            ("upper_arm", "shoulder", "elbow", "upper_arm_flexion"),
            ("lower_arm", "elbow", "wrist", "lower_arm_flexion"),
            ("wrist", "wrist", "hand", "wrist_flexion"),
        )
    },
}
"""Limb -> its two joints and the angle without which it counts as unmeasured."""
SPOTS: Final[dict[str, tuple[str, ...]]] = {
    "trunk": ("chest",),
    "neck": ("neck",),
    "legs": ("knee_left", "knee_right"),
    **{
        f"{part}_{side}": (f"{joint}_{side}",)
        for side in SIDES
        for part, joint in {"upper_arm": "shoulder", "lower_arm": "elbow", "wrist": "wrist"}.items()
    },
}
"""Part score -> the joints that carry its mark."""
VIEWS: Final[tuple[tuple[str, float], ...]] = (
    ("from the right", 0.0),
    ("three-quarter view", 45.0),
    ("from the front", 90.0),
)
"""Title of each view and how far the person is turned towards the viewer [deg]."""
_HEIGHT, _WIDTH, _SCALE = 236.0, 180.0, 165.0
# One scale for all views and postures: arms stretched above the head and in front of a bent trunk fit.
_ROOM: Final = 14.0
"""Above the highest joint, for marks; what is empty above it is cut off."""


@dataclass(frozen=True)
class Mark:
    """A part score to show at its joint: `share` from 0 at its lowest to 1 at its highest value."""

    text: str
    share: float


def _turn(axis: int, degrees: float) -> Array:
    a, (i, j) = np.radians(degrees), [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[[i, j], [i, j]] = np.cos(a)
    matrix[i, j], matrix[j, i] = -np.sin(a), np.sin(a)
    return matrix


def joints(angles: Array, sitting: bool = False) -> dict[str, Array]:
    """Return joint centres (3,) of one posture: x forward, y up, z right, stature 1, the middle of the hips at 0.

    Args:
        angles: (22,) degrees in the order of `reba.COLUMNS`; NaN is drawn neutral.
        sitting: thighs level instead of bearing the weight.

    Example:
        >>> upright = joints(np.zeros(22))
        >>> bool(upright["neck"][1] > upright["hip"][1] > upright["knee_left"][1])
        True
    """
    angles = np.where(np.isnan(angles), NEUTRAL, angles)

    def angle(name: str) -> float:
        return float(angles[INDEX[name]])

    def frame(part: str) -> Array:
        flexed = _turn(2, -angle(f"{part}_flexion")) @ _turn(0, angle(f"{part}_side_bend"))
        return flexed @ _turn(1, angle(f"{part}_twist"))

    trunk = frame("trunk")
    head = trunk @ frame("neck")
    place = {"hip": np.zeros(3), "chest": trunk[:, 1] * LENGTHS["trunk"] * 0.55}
    place["neck"] = trunk[:, 1] * LENGTHS["trunk"]
    place["head"] = place["neck"] + head[:, 1] * (LENGTHS["neck"] + LENGTHS["head"] / 2)
    place["nose"] = place["head"] + head[:, 0] * LENGTHS["head"] * 0.62
    for side, outward in zip(SIDES, (-1.0, 1.0), strict=True):
        values = {name.removesuffix(f"_{side}"): angle(name) for name in INDEX if name.endswith(side)}
        raised = np.radians(np.clip(values["shoulder_elevation"], -20.0, 45.0))
        across = np.array([0.0, np.sin(raised), outward * np.cos(raised)]) * LENGTHS["shoulders"] / 2
        shoulder = place["neck"] + trunk @ (across - np.array([0.0, 0.03, 0.0]))
        arm, forearm, hand = (trunk @ direction for direction in _arm(values, outward))
        place[f"shoulder_{side}"] = shoulder
        place[f"elbow_{side}"] = shoulder + arm * LENGTHS["upper_arm"]
        place[f"wrist_{side}"] = place[f"elbow_{side}"] + forearm * LENGTHS["forearm"]
        place[f"hand_{side}"] = place[f"wrist_{side}"] + hand * LENGTHS["hand"]
        place |= _leg(side, outward, values["knee_flexion"], sitting)
    return place


def _arm(values: dict[str, float], outward: float) -> tuple[Array, Array, Array]:
    """Return the directions of upper arm, forearm and hand in the trunk's frame."""
    names = ("upper_arm_flexion", "upper_arm_abduction", "lower_arm_flexion")
    flex, abduct, elbow = (np.radians(values[name]) for name in names)
    bend, deviate, twist = (np.radians(values[f"wrist_{name}"]) for name in ("flexion", "deviation", "twist"))
    arm = np.array([np.cos(abduct) * np.sin(flex), -np.cos(abduct) * np.cos(flex), outward * np.sin(abduct)])
    # The elbow bends in the arm's plane of flexion: the table does not say how the arm is turned about its axis.
    front = np.array([np.cos(flex), np.sin(flex), 0.0])
    forearm = np.cos(elbow) * arm + np.sin(elbow) * front
    thumb = np.cos(elbow) * front - np.sin(elbow) * arm
    inward = -outward * np.cross(arm, front)
    palm = np.cos(twist) * inward - np.sin(twist) * thumb
    thumb = np.cos(twist) * thumb + np.sin(twist) * inward
    hand = np.cos(bend) * (np.cos(deviate) * forearm - np.sin(deviate) * thumb) + np.sin(bend) * palm
    return arm, forearm, hand


def _leg(side: str, outward: float, knee: float, sitting: bool) -> dict[str, Array]:
    """Return hip, knee, ankle and toe; two fifths of the knee's angle tilt the shank, the rest the thigh."""
    thigh = np.radians(90.0 if sitting else 0.6 * knee)
    shank = np.radians(0.0 if sitting else 0.6 * knee - knee)
    hip = np.array([0.0, 0.0, outward * LENGTHS["hips"] / 2])
    low = hip + np.array([np.sin(thigh), -np.cos(thigh), 0.0]) * LENGTHS["thigh"]
    ankle = low + np.array([np.sin(shank), -np.cos(shank), 0.0]) * LENGTHS["shank"]
    toe = ankle + np.array([0.1, -0.02, 0.0])
    return {f"hip_{side}": hip, f"knee_{side}": low, f"ankle_{side}": ankle, f"toe_{side}": toe}


def stick_figure(
    angles: Array,
    marks: dict[str, Mark],
    label: str,
    sitting: bool = False,
    views: Sequence[tuple[str, float]] = VIEWS,
) -> str:
    """Return one SVG with views of a posture (22,) [deg], NaN = not measured.

    Args:
        marks: part score column -> what to show at its joints.
        label: text for people who cannot see it.
        views: title of each and how far the person is turned towards the viewer [deg].
    """
    place = joints(angles, sitting)
    width = _WIDTH * len(views)
    heights = [point[1] for point in place.values()]
    highest = max(*heights, place["head"][1] + LENGTHS["head"] / 2)
    top = max(_HEIGHT - 8 - (highest - min(heights)) * _SCALE - _ROOM, 0.0)
    drawn = [f'<g transform="translate({i * _WIDTH:g} 0)">{_view(place, angles, marks, title, turn, sitting)}</g>'
             for i, (title, turn) in enumerate(views)]  # fmt: skip
    box = f"0 {top:.1f} {width:g} {_HEIGHT + 20 - top:.1f}"
    opening = f'<svg class="figure" viewBox="{box}" role="img" aria-label="{as_markup(label)}">'
    return f"{opening}{''.join(drawn)}</svg>"


def _view(
    place: dict[str, Array], angles: Array, marks: dict[str, Mark], title: str, turn: float, sitting: bool
) -> str:
    seen = {name: _turn(1, -turn) @ point for name, point in place.items()}
    x = [point[0] for point in seen.values()]
    y = [point[1] for point in seen.values()]
    shift = _WIDTH / 2 - (min(x) + max(x)) / 2 * _SCALE
    floor = _HEIGHT - 8 + min(y) * _SCALE
    at = {name: (shift + p[0] * _SCALE, floor - p[1] * _SCALE) for name, p in seen.items()}
    ground = _HEIGHT - 4
    parts = [f'<line class="floor" x1="8" y1="{ground:g}" x2="{_WIDTH - 8:g}" y2="{ground:g}"/>']
    if sitting:
        parts.append(_stroke("seat", (at["hip"][0] - 26, at["hip"][1] + 7), (at["hip"][0] + 34, at["hip"][1] + 7)))
    # What is further away is drawn first.
    depth = {limb: seen[a][2] + seen[b][2] for limb, (a, b, _) in LIMBS.items()}
    for limb in sorted(LIMBS, key=lambda name: depth[name]):
        a, b, angle = LIMBS[limb]
        kind = "unmeasured" if np.isnan(angles[INDEX[angle]]) else "far" if depth[limb] < -0.1 else "near"
        parts.append(_stroke(f"limb {kind}", at[a], at[b]))
        if limb.startswith("shank"):
            parts.append(_stroke(f"limb {kind}", at[b], at[b.replace("ankle", "toe")]))
    for a, b in (("shoulder_left", "shoulder_right"), ("hip_left", "hip_right")):
        parts.append(_stroke("limb near", at[a], at[b]))
    head = "unmeasured" if np.isnan(angles[INDEX["neck_flexion"]]) else "near"
    radius = LENGTHS["head"] / 2 * _SCALE
    parts.append(f'<circle class="head {head}" cx="{at["head"][0]:.1f}" cy="{at["head"][1]:.1f}" r="{radius:.1f}"/>')
    parts.append(_stroke(f"nose {head}", *(_towards(at["head"], at["nose"], share) for share in (0.75, 1.15))))
    parts += [_badge(at[joint], mark) for part, mark in marks.items() for joint in SPOTS.get(part, ())]
    parts.append(f'<text class="view" x="{_WIDTH / 2:g}" y="{_HEIGHT + 14:g}">{title}</text>')
    return "".join(parts)


def _towards(a: tuple[float, float], b: tuple[float, float], share: float) -> tuple[float, float]:
    return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share


def _stroke(kind: str, a: tuple[float, float], b: tuple[float, float]) -> str:
    return f'<line class="{kind}" x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"/>'


def _badge(at: tuple[float, float], mark: Mark) -> str:
    kind = "severe" if mark.share > 0.5 else "raised"
    return (
        f'<g class="badge {kind}"><circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="8"/>'
        f'<text x="{at[0]:.1f}" y="{at[1] + 3.8:.1f}">{mark.text}</text></g>'
    )
