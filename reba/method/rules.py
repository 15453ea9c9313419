"""The rules: every choice that the paper leaves open as a named field, and the points of a load.

The edges of the angles are in `reba.method.steps`.

Sources: [HM2000] Hignett & McAtamney (2000), Applied Ergonomics 31:201-205; [H2005] Hignett's chapter in Fundamentals
and Assessment Tools for Occupational Ergonomics, Table 42.2 (one +1 for twisted or side flexed, "not for sitting",
walking counts as bilateral).
"""

from __future__ import annotations

import dataclasses
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from reba.checks import PATH, accepts, is_number, shown
from reba.errors import RulesError, did_you_mean
from reba.files import write_atomic, write_text
from reba.open_file import read_settings

LOAD_EDGES: Final = (5.0, 10.0)
"""[kg] Load 0 below 5, 1 from 5 to 10 (both inside), 2 above [HM2000]."""


def load_points(load: Any) -> Any:
    """Return the points of a load [kg], 0 to 2: for a number, an array of any shape or a symbolic expression.

    >>> load_points(5.0)
    1
    """
    return 1 * (load >= LOAD_EDGES[0]) + (load > LOAD_EDGES[1])


@dataclass(frozen=True)
class Rules:
    """Every open choice of the method; `reba.PRESETS` holds `measured` (recordings), `paper` (the letter) and `rater`.

    Tolerances and thresholds are in degrees; an angle equal to a threshold does not count as departed.

    Attributes:
        name: shown in every output.
        trunk_upright: flexion or extension up to which the trunk is upright (class 1).
        neck_upright: extension up to which the neck is not "in extension".
        trunk_twist, trunk_side_bend: more than this counts as twisted, side flexed.
        neck_twist, neck_side_bend: the same for the neck.
        abduction: more than this counts as upper arm abducted.
        shoulder_elevation: more than this counts as shoulder raised.
        wrist_deviation, wrist_twist: more than this counts as wrist bent from the midline, twisted.
        edges: "lower": a printed edge belongs to the lower class (20 deg of trunk flexion scores 2); "upper": to the
            higher one. Ranges printed closed (knee 30, elbow 60) keep their lower end.
        twist_and_bend: "one": one +1 for twisted or side flexed [H2005]; "two": one each, clamped to the table.
        upper_arm_reference: "trunk": against the trunk line, as drawn; "gravity": against the vertical.
        two_sides: which arm gives the total: "worse" (both are always scored), "left" or "right".
        seated_knees: whether bent knees add points while sitting; printed "not for sitting" [H2005].
        walking_legs: leg score while walking; printed with bilateral weight bearing, 1.
        coupling_without_load: whether coupling counts with empty hands (load 0).
        static_seconds, static_range: a part is static while all its angles stay within a band of `static_range`
            degrees for longer than `static_seconds`.
        repeated_per_minute, repeated_min, repeated_max: a part's action is repeated while it makes more than
            `repeated_per_minute` back-and-forth movements of `repeated_min` to `repeated_max` degrees in a minute.
        gait_per_minute: strides a minute (alternating knees) from which an interval is walking, never "repeated".
        rapid_range, rapid_seconds: a change of more than `rapid_range` degrees within `rapid_seconds` is a rapid
            large range change in posture.

    Example:
        >>> rules_of("measured").replace(abduction=45.0).abduction
        45.0
    """

    name: str = "measured"
    trunk_upright: float = 5.0
    neck_upright: float = 5.0
    trunk_twist: float = 10.0
    trunk_side_bend: float = 10.0
    neck_twist: float = 10.0
    neck_side_bend: float = 10.0
    abduction: float = 30.0
    shoulder_elevation: float = 10.0
    wrist_deviation: float = 10.0
    wrist_twist: float = 30.0
    edges: Literal["lower", "upper"] = "lower"
    twist_and_bend: Literal["one", "two"] = "one"
    upper_arm_reference: Literal["trunk", "gravity"] = "trunk"
    two_sides: Literal["worse", "left", "right"] = "worse"
    seated_knees: bool = False
    walking_legs: int = 1
    coupling_without_load: bool = True
    static_seconds: float = 60.0
    static_range: float = 10.0
    repeated_per_minute: float = 4.0
    repeated_min: float = 10.0
    repeated_max: float = 60.0
    gait_per_minute: float = 30.0
    rapid_range: float = 60.0
    rapid_seconds: float = 0.5

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            _check(field.name, getattr(self, field.name))

    def replace(self, **changes: Any) -> Rules:
        """Return a copy with some fields changed.

        Raises:
            RulesError: a field is unknown or a value out of range.
        """
        return _build({**dataclasses.asdict(self), **changes}, "the rules")

    def to_toml(self) -> str:
        """Return the record as TOML, one field a line."""
        return "".join(f"{key} = {_toml(value)}\n" for key, value in dataclasses.asdict(self).items())

    @accepts(RulesError, path=PATH)
    def save(self, path: str | Path) -> None:
        """Write the record as TOML; `Rules.load` reads it back equal.

        Raises:
            RebaError: the place cannot be written to.
        """
        write_atomic(Path(path), lambda part: write_text(part, self.to_toml()))

    @staticmethod
    @accepts(RulesError, path=PATH)
    def load(path: str | Path) -> Rules:
        """Read a TOML file; fields left out keep the preset named by `preset` ("measured" if that is left out too).

        Raises:
            RulesError: the file cannot be read, a field is unknown or a value out of range.
        """
        try:
            fields = tomllib.loads(read_settings(path))
        except (OSError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise RulesError(f"{path}: cannot be read as rules ({why}); give a TOML file or a preset") from error
        except (ValueError, RecursionError) as error:  # also numbers of thousands of digits, and deep nesting
            raise RulesError(f"{path}: not TOML ({error})") from error
        preset = fields.pop("preset", "measured")
        if str(preset) not in PRESETS:
            raise RulesError(f"{path}: preset {preset!r} is unknown; use one of {', '.join(PRESETS)}")
        base = dataclasses.asdict(PRESETS[preset])
        try:
            return _build({**base, "name": Path(path).stem, **fields}, str(path))
        except RulesError as error:
            text = str(error)
            raise RulesError(text if text.startswith(str(path)) else f"{path}: {text}") from error


_CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "edges": ("lower", "upper"),
    "twist_and_bend": ("one", "two"),
    "upper_arm_reference": ("trunk", "gravity"),
    "two_sides": ("worse", "left", "right"),
}
# An upright trunk ends before the first printed edge.
_TOLERANCE_LIMITS: Final[dict[str, float]] = {"trunk_upright": 19.0, "neck_upright": 90.0}
_FLAGS: Final = ("seated_knees", "coupling_without_load")


def _check(name: str, value: object) -> None:
    if name == "name":
        if not isinstance(value, str) or not value or not value.isprintable():
            raise RulesError(f"rules name is {shown(value)}; expected a text of one line")
    elif name in _CHOICES:
        if not isinstance(value, str) or value not in _CHOICES[name]:
            raise RulesError(f"{name} is {shown(value)}; expected one of {', '.join(_CHOICES[name])}")
    elif name in _FLAGS:
        if not isinstance(value, bool):
            raise RulesError(f"{name} is {shown(value)}; expected true or false")
    elif name == "walking_legs":
        if not is_number(value) or value not in (1, 2):
            raise RulesError(f"walking_legs is {shown(value)}; expected 1 or 2")
    else:
        limit = _TOLERANCE_LIMITS.get(name, 1e6)
        number = value if isinstance(value, (int, float)) and not isinstance(value, bool) else None
        if number is None or not 0.0 <= number <= limit:
            raise RulesError(f"{name} is {shown(value)}; expected a number from 0 to {limit:g}")


def _build(fields: dict[str, Any], where: str) -> Rules:
    known = {field.name for field in dataclasses.fields(Rules)}
    for key in fields:
        if key not in known:
            raise RulesError(
                f"{where}: unknown field {key!r}{did_you_mean(key, known)}; known: {', '.join(sorted(known))}"
            )
    return Rules(**fields)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    return repr(float(value)) if isinstance(value, float) else str(value)


_ANY_DEPARTURE: Final[dict[str, Any]] = dict.fromkeys(
    (
        "trunk_upright", "neck_upright", "trunk_twist", "trunk_side_bend", "neck_twist", "neck_side_bend",
        "abduction", "shoulder_elevation", "wrist_deviation", "wrist_twist",
    ),
    0.0,
)  # fmt: skip
RATER: Final[dict[str, tuple[float, str]]] = {
    "trunk_upright": (10.0, "visual estimates of trunk, shoulder and wrist are 7 to 10 deg off (Covalla)"),
    "neck_upright": (10.0, "a choice: as the trunk; estimates of the neck are inaccurate (Whitcroft et al. 2010)"),
    "trunk_twist": (15.0, "a choice: as trunk_side_bend"),
    "trunk_side_bend": (15.0, "classes of 15 deg are what observers tell apart best (van Wyk et al. 2009, NIOSH 2014)"),
    "neck_twist": (15.0, "a choice: as trunk_side_bend"),
    "neck_side_bend": (15.0, "a choice: as trunk_side_bend"),
    "abduction": (30.0, "classes of 30 deg are what observers tell apart best (van Wyk et al. 2009, NIOSH 2014)"),
    "shoulder_elevation": (10.0, "a choice: as in `measured`; it is not judged in degrees"),
    "wrist_deviation": (15.0, "estimates of the hand are 14.0 deg off (Ergonomics 55:885-897, 2012), rounded"),
    "wrist_twist": (45.0, "a choice: half the range; observers hardly see pronation (McKinnon et al.)"),
}
"""Tolerances [deg] of the preset `rater` with where they come from; the sources are in docs/references.md.

The rule: a departure counts from where an observer can tell it from none, by the error of visual estimates or the
width of the classes that observers tell apart. No set of ratings was looked at when the numbers were chosen.
"""
PRESETS: Final[dict[str, Rules]] = {
    "measured": Rules(),
    "paper": dataclasses.replace(Rules(name="paper"), **_ANY_DEPARTURE),
    "rater": Rules(name="rater").replace(**{field: degrees for field, (degrees, _) in RATER.items()}),
}
"""`measured`: tolerances that sensors need, the default for recordings. `paper`: the letter, any departure counts.
`rater`: tolerances of what observers can tell apart, to compare with scores that people give."""


def rules_of(which: str | Path | Rules) -> Rules:
    """Return a preset by name, the rules in a TOML file, or the record itself.

    Raises:
        RulesError: neither a preset nor a readable rules file.

    Example:
        >>> rules_of("paper").trunk_upright
        0.0
    """
    if isinstance(which, Rules):
        return which
    if isinstance(which, str | Path):
        if str(which) in PRESETS:
            return PRESETS[str(which)]
        if str(which).endswith(".toml"):
            return Rules.load(str(which))
    raise RulesError(f"rules {shown(which)} are unknown; use {', '.join(PRESETS)}, or a file ending in .toml")
