"""Extraction of 3D keypoints from messages that draw or list them: markers, poses, scenes.

None of these types is made for bodies, so nothing but the place of each point and its name is taken: the text of a
marker, its namespace and id, or the order of poses, which a profile has to name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from reba.readers.mcap.extract import TEXTS, Extractor, SignalGroup, Value, fields_of, number, stamp_of
from reba.readers.mcap.layout import Undecodable, Walked

MARKER_FIELDS: Final = TEXTS | {"ns", "id", "text", "type", "action"}
SCENE_FIELDS: Final = TEXTS | {"id", "text"}
_CUBE, _SPHERE, _TEXT = 1, 2, 9
_POINT_TYPES: Final = (_SPHERE, _CUBE, _TEXT)
"""Types of markers that are one point, in the order of preference: cylinders are bones, texts often stand beside."""
_ADD: Final = 0
_XYZ: Final = ("x", "y", "z")

MOST_BYTES: Final = 1 << 17
"""[bytes] Longest message with points that is read, some hundred of them; a choice."""
MOST_NAMES: Final = 2000
"""Names that the points of one topic may have; a choice, many times those of all bodies in view."""


class FewPoints:
    """Walks and extracts messages with points of bodies, and refuses others early.

    Maps, clouds of particles and labels whose text is a measured value have the same types, and walking thousands of
    them that are all different would take minutes.
    """

    def __init__(self, walk: Callable[[bytes], Walked], extract: Extractor) -> None:
        self._walk = walk
        self._extract = extract
        self._names: set[str] = set()

    def walk(self, message: bytes) -> Walked:
        """Return the fields of a message.

        Raises:
            Undecodable: it does not fit the schema, or has more points than bodies have.
        """
        if len(message) > MOST_BYTES:
            raise Undecodable(f"its {len(message)} bytes are more points than bodies have")
        if len(self._names) > MOST_NAMES:
            raise Undecodable(f"the points of its topic had more than {MOST_NAMES} names, so they are no bodies")
        return self._walk(message)

    def extract(self, tree: Any) -> list[SignalGroup]:
        """Return the points of a message."""
        groups = self._extract(tree)
        for group in groups:
            self._names.update(group.names)
        return groups


def extract_markers(tree: Any) -> list[SignalGroup]:
    """Return the places of the spheres of a MarkerArray or Marker, or else of its cubes or texts.

    A point is named "<namespace>/<text>"; without text by its namespace where no other marker of the message has that,
    else "<namespace>/<id>", and without namespace "marker_<id>".

    Raises:
        Undecodable: it has none of these, or they are in several frames, or two have one name.
    """
    fields = fields_of(tree)
    markers = fields.get("markers", [fields])
    if not isinstance(markers, list):
        raise Undecodable("it has no markers")
    shown = [fields_of(marker) for marker in markers if fields_of(marker).get("action", _ADD) == _ADD]
    if not shown:
        return []
    chosen = next((same for kind in _POINT_TYPES if (same := [one for one in shown if one.get("type") == kind])), [])
    if not chosen:
        raise Undecodable("it has no spheres, cubes or texts (lists and lines are not read: draw a sphere per point)")
    spaces = Counter(str(marker.get("ns", "")) for marker in chosen)
    alone = len(spaces) == len(chosen) > 1
    return _points(stamp_of(chosen[0]), [(_marker_name(marker, alone), marker) for marker in chosen])


def _marker_name(marker: Mapping[str, Any], alone: bool) -> str:
    space, text = str(marker.get("ns", "")), str(marker.get("text", "")).strip()
    if text:
        return _of(space, text)
    if space:
        return space if alone else f"{space}/{marker.get('id')}"
    return f"marker_{marker.get('id')}"


def _of(body: str, text: str) -> str:
    """Return the name of a point by its text, of the body that it belongs to if that is named."""
    return f"{body}/{text}" if body not in ("", text) else text


def extract_poses(tree: Any) -> list[SignalGroup]:
    """Return the places of a PoseArray or PosesInFrame, named "pose_0", "pose_1" ... by their order.

    Raises:
        Undecodable: it has none.
    """
    fields = fields_of(tree)
    poses = fields.get("poses")
    if not isinstance(poses, list) or not poses:
        raise Undecodable("it has no poses")
    return _points(stamp_of(fields), [(f"pose_{index}", {"pose": pose}) for index, pose in enumerate(poses)])


def extract_scene(tree: Any) -> list[SignalGroup]:
    """Return the places of the spheres, else cubes or texts, of a SceneUpdate.

    A point is named "<id>/<text>" with the id of its entity; without text by the id, "<id>/<order>" if it has several.

    Raises:
        Undecodable: it has none of these, or they are in several frames, or two have one name.
    """
    entities = fields_of(tree).get("entities", [])
    if not isinstance(entities, list):
        raise Undecodable("it has no entities")
    if not entities:
        return []
    for kind in ("spheres", "cubes", "texts"):
        named: list[tuple[str, Mapping[str, Any]]] = []
        for entity in map(fields_of, entities):
            shapes = entity.get(kind, [])
            for index, item in enumerate(shapes if isinstance(shapes, list) else []):
                body, text = str(entity.get("id", "")), str(fields_of(item).get("text", "")).strip()
                name = _of(body, text) if text else f"{body}/{index}" if len(shapes) > 1 else body
                named.append((name, {**fields_of(item), "header": {"frame_id": entity.get("frame_id", "")}}))
        if named:
            return _points(stamp_of(fields_of(entities[0])), named)
    raise Undecodable("it has no spheres, cubes or texts")


def _points(stamp: Any, named: Sequence[tuple[str, Mapping[str, Any]]]) -> list[SignalGroup]:
    """Return the places of things with a `pose`, all of which have one time and one frame, and names of their own."""
    name, count = Counter(name for name, _ in named).most_common(1)[0]
    if count > 1:
        raise Undecodable(f"{count} of its points are named {name[:40]!r}; give each body a namespace of its own")
    frames = {str(fields_of(item.get("header", {})).get("frame_id", "")) for _, item in named}
    if len(frames) > 1:
        raise Undecodable(f"its points are in several frames ({', '.join(sorted(frames)[:3])})")
    values: list[Value] = []
    for _, item in named:
        position = fields_of(fields_of(item.get("pose", {})).get("position", {}))
        # Protobuf omits numbers that are zero.
        values += [number(position.get(axis, 0.0)) for axis in _XYZ]
    return [SignalGroup(stamp, tuple(name for name, _ in named), (), tuple(values))]
