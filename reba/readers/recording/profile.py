"""Profiles: the meaning of the names in a recording, as data.

A profile states for one kind of source the names of its joints, frames or points, about which axes and with which sign
they rotate, which columns it cannot measure and why. The shipped ones are the TOML files in `profiles/`; for other
names, write a file like them and pass its path (`--profile FILE.toml`).

docs/profiles.md describes every key with examples; `_FIELDS` is the list of them.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

from reba.checks import PATH, Allowed, from_home, is_finite
from reba.errors import ProfileError, did_you_mean
from reba.open_file import read_settings
from reba.posture.columns import ANGLES, COLUMNS, SIDES
from reba.toml_table import TomlTable

Kind = Literal["joints", "frames", "points"]
KINDS: tuple[Kind, ...] = ("joints", "frames", "points")
AXES = ("isb", "ros", "gltf", "rest")
"""isb: x forward, y up, z right; ros: x forward, y left, z up; gltf: x left, y up, z forward; rest: determined from the
rest pose of the recording."""


@dataclass(frozen=True)
class ElementaryRotation:
    """Elementary rotation of a chain: about axis 0, 1 or 2 by `sign` times joint `name`, or by a constant [deg]."""

    axis: int
    sign: float
    name: str
    degrees: float = 0.0


@dataclass(frozen=True)
class Term:
    """Summand of a directly measured column: `sign` times joint `name`, or a constant [deg] without name."""

    sign: float
    name: str
    degrees: float = 0.0


@dataclass(frozen=True)
class Profile:
    """The meaning of the names of one kind of source; the fields are the keys of its TOML file (see the module).

    Attributes:
        title, source: description, and where the source is documented.
        formats: formats in which it is usual, for information.
        unit: unit of joints if the recording does not state it: "rad", "deg" or "".
        axes: axes of frames, one of `AXES`.
        up: vertical axis of the world in the source's own axes, "" where the body decides.
        mirror: chains are written for the right side and mirrored for the left.
        trunk: "line" (hips to shoulders) or "thorax" (orientation of the chest).
        required: groups of names, segments or points; one of each group must be present.
        marks: further names that identify this source; all must be present.
        turns: constant rotations of frames.
        root: frames with the pose of the pelvis of a joints profile, if they are recorded too, with axes `root_axes`.
        sign_from_range: columns whose sign differs between models and is determined from the data.
        needs_neutral: columns without anatomical zero, measured only with a neutral posture; of points, where the file
            does not say, `ZEROLESS`.
        cannot: column -> why it is not measured.
        assumed: assumptions to report with the result.
    """

    name: str
    title: str
    source: str
    kind: Kind
    formats: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ("{name}",)
    unit: str = ""
    axes: str = "isb"
    up: str = ""
    mirror: bool = True
    trunk: str = "line"
    required: tuple[tuple[str, ...], ...] = ()
    marks: tuple[str, ...] = ()
    chains: Mapping[str, tuple[ElementaryRotation, ...]] = field(default_factory=dict)
    columns: Mapping[str, tuple[Term, ...]] = field(default_factory=dict)
    segments: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    points: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    turns: Mapping[str, tuple[ElementaryRotation, ...]] = field(default_factory=dict)
    dummies: Mapping[str, float] = field(default_factory=dict)
    root: tuple[str, ...] = ()
    root_axes: str = "ros"
    sign_from_range: tuple[str, ...] = ()
    needs_neutral: tuple[str, ...] = ()
    cannot: Mapping[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All joint, frame or marker names, each once."""
        return tuple(dict.fromkeys(name for group in self.slots.values() for word in group for name in word.split("|")))

    @cached_property
    def slots(self) -> Mapping[str, tuple[str, ...]]:
        """Joint, segment or point -> its names in a recording."""
        if self.kind != "joints":
            return dict(self.segments if self.kind == "frames" else self.points)
        joints = [step.name for chain in self.chains.values() for step in chain]
        joints += [term.name for terms in self.columns.values() for term in terms]
        return {name: tuple(name.split("|")) for name in joints if name}


SHIPPED = Path(__file__).parent / "profiles"
"""Folder of the profiles of the package."""


@cache
def profiles() -> tuple[Profile, ...]:
    """Return the shipped profiles, sorted by name."""
    return tuple(load_profile(path) for path in sorted(SHIPPED.glob("*.toml")))


def profile_text(name: str) -> str:
    """Return the text of the TOML file of a shipped profile, as a start for another one."""
    path = SHIPPED / f"{find_profile(name).name}.toml"
    if not path.is_file():
        raise ProfileError(f"{name} is a profile file, expected the name of a shipped profile; see `reba profiles`")
    return read_settings(path)


PROFILE = Allowed(
    "'auto', the name of a profile, a TOML file or a Profile",
    lambda value: PATH.fits(value) or isinstance(value, Profile),
    from_home,
)
"""What a profile may be given as."""


def find_profile(name: str | Path | Profile) -> Profile:
    """Return the shipped profile of a name, the one in a TOML file, or the profile itself.

    Raises:
        ProfileError: no profile or file has this name, or the file is wrong.
    """
    if isinstance(name, Profile):
        return name
    known = {profile.name: profile for profile in profiles()}
    if str(name) in known:
        return known[str(name)]
    if str(name).endswith(".toml") or os.path.isfile(name):
        return load_profile(Path(name))
    raise ProfileError(
        f"no profile {str(name)!r}{did_you_mean(str(name), known)}; known are {', '.join(known)}, or give a TOML file"
    )


MIDDLE = ("pelvis", "thorax", "head")
SIDED = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot", "toe")
POINTS_MIDDLE = ("neck", "head", "head_front", "head_back", "nose", "notch", "xiphoid", "c7", "t8")
POINTS_SIDED = (
    *("asis", "psis", "hip", "shoulder", "elbow", "elbow_lateral", "elbow_medial"),
    *("wrist", "wrist_radial", "wrist_ulnar", "hand", "hand_radial", "hand_ulnar"),
    *("knee", "knee_lateral", "knee_medial", "ankle", "ankle_lateral", "ankle_medial", "toe", "heel", "ear"),
)
GROUPS: dict[str, tuple[str, ...]] = {
    "trunk": ("trunk_flexion", "trunk_side_bend", "trunk_twist"),
    "neck": ("neck_flexion", "neck_side_bend", "neck_twist"),
    "legs": ("knee_flexion",),
    "arms": ("upper_arm_flexion", "upper_arm_abduction", "lower_arm_flexion"),
    "wrists": ("wrist_flexion", "wrist_deviation", "wrist_twist"),
}
"""Short names for several columns in `[cannot]` and `needs_neutral`."""
ZEROLESS = tuple(f"shoulder_elevation_{side}" for side in SIDES)
"""Columns whose zero depends on where points are on the body; of the others it is anatomical, or nearly."""


def load_profile(path: Path) -> Profile:
    """Read and check a profile file."""
    try:
        content = tomllib.loads(read_settings(path))
    except OSError as error:
        raise ProfileError(f"profile {path}: {error.strerror or error}; give the path of a TOML file") from error
    except (ValueError, RecursionError) as error:
        raise ProfileError(f"profile {path}: not TOML: {error}; correct the file") from error
    return parse_profile(content, str(path))


def parse_profile(content: Mapping[str, Any], where: str) -> Profile:
    """Return the profile of parsed TOML; `where` names the file in messages.

    Raises:
        ProfileError: a key is missing or unknown, or a value is not what it should be.
    """
    table = TomlTable(f"profile {where}", content, ProfileError)
    keys = table.keys(_FIELDS)
    for key in ("name", "title", "source"):
        table.text(key)
    kind = table.text("kind", choices=KINDS)
    values = {key: _FIELDS[key](table, key) for key in keys}
    if kind == "points":
        values.setdefault("needs_neutral", ZEROLESS)
    profile = Profile(**values)
    needed = {"joints": ("chains", "columns"), "frames": ("segments",), "points": ("points",)}[kind]
    if not any(getattr(profile, section) for section in needed):
        raise ProfileError(f"{table.where}: kind '{kind}' needs a section [{'] or ['.join(needed)}]; add it")
    for pattern in profile.patterns:
        if pattern.count("{name}") != 1 or pattern.count("{id}") > 1:
            raise ProfileError(f"{table.where}: pattern {pattern!r}, expected one {{name}}, like '{{id}}_{{name}}'")
    for group in profile.required:
        if not set(group) & set(profile.slots):
            hint = did_you_mean(group[0], profile.slots) or "; describe it in a section"
            raise ProfileError(f"{table.where}: required {group[0]!r} is in no section{hint}")
    return profile


def _text(*choices: str) -> Callable[[TomlTable, str], str]:
    return lambda table, key: table.text(key, choices=choices or None)


def _chains(table: TomlTable, key: str) -> dict[str, tuple[ElementaryRotation, ...]]:
    inner = table.table(key)
    items = _by_side(inner, MIDDLE, SIDED, "segment", least=1)
    return {name: tuple(_rotation(item, inner.where) for item in chain) for name, chain in items.items()}


def read_columns(table: TomlTable, key: str) -> dict[str, tuple[Term, ...]]:
    """Return column -> its joints with their signs and degrees to add, of a table in a TOML file."""
    inner = table.table(key)
    middle = [angle.name for angle in ANGLES if not angle.sided]
    items = _by_side(inner, middle, [angle.name for angle in ANGLES if angle.sided], "column", least=1)
    return {name: tuple(_term(item, inner.where) for item in terms) for name, terms in items.items()}


def _segments(table: TomlTable, key: str) -> dict[str, tuple[str, ...]]:
    return {name: tuple(items) for name, items in _by_side(table.table(key), MIDDLE, SIDED, "segment").items()}


def _points(table: TomlTable, key: str) -> dict[str, tuple[str, ...]]:
    items = _by_side(table.table(key), POINTS_MIDDLE, POINTS_SIDED, "point")
    return {name: tuple(markers) for name, markers in items.items()}


def _dummies(table: TomlTable, key: str) -> dict[str, float]:
    return {word: value for name, value in table.numbers(key).items() for word in _both(name)}


def _cannot(table: TomlTable, key: str) -> dict[str, str]:
    inner = table.table(key)
    known = (*GROUPS, *(angle.name for angle in ANGLES), *COLUMNS)
    return {column: inner.text(name) for name in inner.keys(known, "column") for column in _columns_of(name)}


def _column_names(table: TomlTable, key: str) -> tuple[str, ...]:
    columns = tuple(column for name in table.names(key) for column in _columns_of(name))
    TomlTable(f"{table.where}: {key}", dict.fromkeys(columns), ProfileError).keys(COLUMNS, "column")
    return columns


def _groups(table: TomlTable, key: str) -> tuple[tuple[str, ...], ...]:
    return tuple(_both(name) for name in table.names(key))


_FIELDS: dict[str, Callable[[TomlTable, str], Any]] = {
    **dict.fromkeys(("name", "title", "source"), _text()),
    "kind": _text(*KINDS),
    **dict.fromkeys(("formats", "patterns", "marks", "root", "assumed"), TomlTable.names),
    "unit": _text("rad", "deg", ""),
    "axes": _text(*AXES),
    "up": _text("", "x", "y", "z", "-x", "-y", "-z"),
    "mirror": TomlTable.flag,
    "trunk": _text("line", "thorax"),
    "required": _groups,
    "chains": _chains,
    "columns": read_columns,
    "segments": _segments,
    "points": _points,
    "turns": _chains,
    "dummies": _dummies,
    "root_axes": _text(*AXES[:3]),
    "sign_from_range": _column_names,
    "needs_neutral": _column_names,
    "cannot": _cannot,
}
"""Key of a profile file -> the function that reads and checks its value."""


def _both(text: str) -> tuple[str, ...]:
    """Return the text for left and right, or itself where it has no side."""
    left, right = (_with_side(text, side) for side in SIDES)
    return (text,) if left == right == text else (left, right)


def _with_side(text: str, side: str) -> str:
    for mark, word in (("side", side), ("Side", side.title()), ("s", side[0]), ("S", side[0].upper())):
        text = text.replace(f"{{{mark}}}", word)
    return text


def _by_side(
    table: TomlTable, middle: Iterable[str], sided: Collection[str], what: str, least: int = 0
) -> dict[str, list[Any]]:
    """Return name -> items, an entry of both sides once per side: `forearm = "{side}_x"` gives forearm_left and _right.

    An entry of one side takes the place of that of both, wherever it stands.

    Args:
        middle, sided: names without and with a side.
        what: what messages call a name.
        least: items that a list of rotations or terms must have; 0: every item must be a name.
    """
    result: dict[str, list[Any]] = {}
    names = table.keys((*middle, *sided, *(f"{part}_{side}" for part in sided for side in SIDES)), what)
    for name in sorted(names, key=lambda name: name not in sided):
        value = table.values[name]
        items = value if isinstance(value, list) else [value]
        if not least:
            table.names(name)
        elif len(items) < least:
            raise ProfileError(f'{table.where}: {name} is {value!r}, expected a list like ["+z left_elbow"]')
        for side in SIDES if name in sided else ():
            result[f"{name}_{side}"] = [_with_side(item, side) if isinstance(item, str) else item for item in items]
        if name not in sided:
            result[name] = items
    return result


def _columns_of(name: str) -> tuple[str, ...]:
    """Return the columns of a group, of an angle of both sides, or the column itself."""
    if name in GROUPS:
        return tuple(column for part in GROUPS[name] for column in _columns_of(part))
    return next((angle.columns for angle in ANGLES if angle.name == name), (name,))


def _rotation(item: Any, where: str) -> ElementaryRotation:
    words = item.split() if isinstance(item, str) else []
    if len(words) != 2 or words[0] not in ("+x", "-x", "+y", "-y", "+z", "-z"):
        raise ProfileError(f"{where}: rotation {item!r}, expected like '+z left_elbow' or '-x 90'")
    sign, axis = (-1.0 if words[0][0] == "-" else 1.0), "xyz".index(words[0][1])
    try:
        degrees = float(words[1])
    except ValueError:
        return ElementaryRotation(axis, sign, words[1])
    if not is_finite(degrees):
        raise ProfileError(f"{where}: rotation {item!r}, expected finite degrees, like '-x 90'")
    return ElementaryRotation(axis, sign, "", degrees)


def _term(item: Any, where: str) -> Term:
    if isinstance(item, str) and item.strip("+- "):
        return Term(-1.0 if item[0] == "-" else 1.0, item[1:].strip() if item[0] in "+-" else item)
    if not is_finite(item):
        raise ProfileError(
            f"{where}: term {repr(item)[:80]}, expected a joint like '-left_elbow' or a number of degrees"
        )
    return Term(1.0, "", float(item))
