"""What the names in a recording mean: profiles, as data.

A profile says for one kind of source which joints, frames or points it names, about which axes and with which sign they
turn, what it cannot measure and why. The shipped ones are the TOML files in `profiles/`; a laboratory with its own
names writes another one and gives its path (`--profile FILE.toml`).

A TOML file has `name`, `title`, `source`, `kind` and, as far as they apply:

    patterns   how names are written: "{name}", "{name}_{id}", "{id}_{name}"; `{id}` tells bodies apart, `*` is anything
    required   names (or segments, points) without which it is not this source; all others may be missing
    [chains]   joints: segment = ["<sign><axis> <joint>", ...], turned in this order about the segment's own ISB axes
               (x forward, y up, z right); a number instead of a joint is a fixed turn in degrees,
               "a|b" a joint that is called a or b
    [columns]  joints: column = ["<sign><joint>", ..., <degrees>], a sum that is the angle itself
    [segments] frames: segment = ["<frame>", ...], the first of them that is present
    [points]   points: point = ["<marker>", ...], the mean of them
    [dummies]  joint (or column) = value [deg] that only fills the place of one that was not measured
    [cannot]   column (or "trunk", "neck", "arms", "wrists", "legs") = reason

`{side}`, `{Side}`, `{s}`, `{S}` stand for left/right, Left/Right, l/r, L/R; the entry then holds for both sides.
Chains are written for the right side; on the left x and y turn the other way, unless `mirror = false`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

from reba.errors import ProfileError, did_you_mean

Kind = Literal["joints", "frames", "points"]
KINDS: tuple[Kind, ...] = ("joints", "frames", "points")

AXES = ("isb", "ros", "rest")
"""isb: x forward, y up, z right; ros: x forward, y left, z up; rest: found from the rest pose of the recording."""


@dataclass(frozen=True)
class Step:
    """One elementary turn of a chain: about `axis` 0, 1 or 2, by `sign` times joint `name`, or by `degrees`."""

    axis: int
    sign: float
    name: str
    degrees: float = 0.0


@dataclass(frozen=True)
class Term:
    """One summand of a directly measured column: `sign` times joint `name`, or `degrees` where the name is empty."""

    sign: float
    name: str
    degrees: float = 0.0


@dataclass(frozen=True)
class Profile:
    """The meaning of the names of one kind of source; the fields are the keys of its TOML file.

    Attributes:
        name, title, source: what it is called, for people, and where it is described.
        kind: "joints", "frames" or "points".
        formats: readers it is usual with, for people.
        patterns: how names are written, see the module.
        unit: unit of joints if the recording does not say: "rad", "deg" or "".
        axes: axes of frames, one of `AXES`.
        up: vertical axis of the world in the source's own axes, "" where it has to be found.
        mirror: chains are written for the right side and mirrored for the left.
        trunk: "line" (hips to shoulders) or "thorax" (orientation of the chest).
        required: names, segments or points that must be present.
        marks: further names that only this source has; all must be present.
        chains, columns, segments, points, dummies, turns: see the module; `turns` are fixed turns of frames.
        root: frames that carry the pose of the pelvis of a joints profile, if the recording holds them too.
        root_axes: axes of these frames.
        sign_from_range: columns whose sign differs between models and is taken from the data.
        needs_neutral: columns without a zero of their own, measured only after a neutral calibration.
        cannot: column -> why it is not measured.
        assumed: what a reader of the result must know.
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
    required: tuple[str, ...] = ()
    marks: tuple[str, ...] = ()
    chains: Mapping[str, tuple[Step, ...]] = field(default_factory=dict)
    columns: Mapping[str, tuple[Term, ...]] = field(default_factory=dict)
    segments: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    points: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    turns: Mapping[str, tuple[Step, ...]] = field(default_factory=dict)
    dummies: Mapping[str, float] = field(default_factory=dict)
    root: tuple[str, ...] = ()
    root_axes: str = "ros"
    sign_from_range: tuple[str, ...] = ()
    needs_neutral: tuple[str, ...] = ()
    cannot: Mapping[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Every joint, frame or marker name it knows, each once."""
        return tuple(dict.fromkeys(name for group in self.slots.values() for name in group))

    @property
    def slots(self) -> dict[str, tuple[str, ...]]:
        """What can be present or missing -> its names: each joint, each segment, each point."""
        if self.kind != "joints":
            return dict(self.segments if self.kind == "frames" else self.points)
        joints = [step.name for chain in self.chains.values() for step in chain]
        joints += [term.name for terms in self.columns.values() for term in terms]
        return {name: tuple(name.split("|")) for name in joints if name}

    def measures(self) -> tuple[str, ...]:
        """The columns it gives where all its names are recorded."""
        from reba.readers.mapping import obtainable

        return obtainable(self, self.slots)


SHIPPED = Path(__file__).parent / "profiles"
"""Where the TOML files of the package are."""


@cache
def profiles() -> tuple[Profile, ...]:
    """Return the shipped profiles, by name."""
    from reba.readers.profile_file import load_profile

    return tuple(load_profile(path) for path in sorted(SHIPPED.glob("*.toml")))


def profile_text(name: str) -> str:
    """Return the TOML file of a shipped profile, to start one's own from.

    Raises:
        ProfileError: there is no such profile.
    """
    path = SHIPPED / f"{find_profile(name).name}.toml"
    if not path.is_file():
        raise ProfileError(f"{name}: this is a file of your own already; name one of the shipped profiles")
    return path.read_text(encoding="utf-8")


def find_profile(name: str | Path) -> Profile:
    """Return the shipped profile of a name, or the one in a TOML file.

    Raises:
        ProfileError: there is no such profile or file, or the file is wrong.
    """
    from reba.readers.profile_file import load_profile

    known = {profile.name: profile for profile in profiles()}
    if str(name) in known:
        return known[str(name)]
    if str(name).endswith(".toml") or Path(name).is_file():
        return load_profile(Path(name))
    raise ProfileError(
        f"no profile {str(name)!r}{did_you_mean(str(name), known)}; known are {', '.join(known)}, or give a TOML file"
    )
