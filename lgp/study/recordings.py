"""Recordings of a study with their labels, and planned recordings that were not made.

files, folders, manifest, pattern -> `Sources`. A recording without a label is reported as a failure; the others are
used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lgp.errors import LgpError
from lgp.files import STUDY_FILES
from lgp.study.labels import RECORD, Label, Pattern, read_manifest, recorded_label
from reba.batch.run import find_inputs
from reba.errors import RebaError
from reba.file_stamp import Stamp, stamp_before


@dataclass(frozen=True)
class Failure:
    """Recording that could not be used: its file, the error, and its label if it is known."""

    input: str
    error: str
    label: Label | None = None


@dataclass(frozen=True)
class Sources:
    """The recordings of a study.

    Attributes:
        named: (file, label) of each.
        unnamed: recordings without a label.
        absent: labels of recordings in the manifest that were not made or not given.
        by_manifest: whether labels, and the order of the conditions, are those of a manifest.
        stamps: file -> stamp of a recording from before its label was read in it.
        conditions: in their order.
    """

    named: tuple[tuple[str, Label], ...]
    unnamed: tuple[Failure, ...] = ()
    absent: tuple[Label, ...] = ()
    by_manifest: bool = False
    stamps: dict[str, Stamp] = field(default_factory=dict)
    conditions: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        names = [label.condition for _, label in self.named] + [label.condition for label in self.absent]
        order = dict.fromkeys(names if self.by_manifest else sorted(names))
        object.__setattr__(self, "conditions", tuple(order))


def find_sources(
    logs: Sequence[str],
    manifest: str | Path | None = None,
    pattern: str | None = None,
    exclude: str | Path | None = None,
) -> Sources:
    """Recordings with their labels.

    Args:
        logs: files and folders of recordings; may be empty with a manifest, which then names them all.
        manifest: CSV file with the labels, instead of those in the recordings.
        pattern: of file names with the labels, instead of those in the recordings.
        exclude: folder of results, which is not searched for recordings; of a folder that holds the logs too, only the
            files of a study are left out.

    Raises:
        LgpError: there is no input, the manifest or pattern is wrong, no recording has a label, or two have the same.
        RebaError: a file or folder does not exist.
    """
    if manifest is not None and pattern is not None:
        raise LgpError("--manifest and --pattern were both given; choose one of them")
    if not logs and manifest is None:
        raise LgpError("no recording was given; name files or folders, or a --manifest")
    inputs = find_inputs(logs) if logs else []
    if exclude is not None:
        inputs = [one for one in inputs if not _is_result(Path(one).resolve(), Path(exclude).resolve(), logs)]
    sources = _by_manifest(inputs, manifest) if manifest is not None else _by_name(inputs, pattern)
    if not sources.named:
        first = f"; the first: {sources.unnamed[0].error}" if sources.unnamed else ""
        raise LgpError(f"none of the {len(sources.unnamed)} recordings is labelled{first}")
    _check([*sources.named, *(("", label) for label in sources.absent)])
    return sources


def _is_result(file: Path, results: Path, logs: Sequence[str]) -> bool:
    """Return whether a file lies in the folder of results; where the logs are in it too, whether a study writes it."""
    if any(results in (log, *log.parents) for log in (Path(name).resolve() for name in logs)):
        return file in [results / name for name in STUDY_FILES]
    return results in file.parents


def _by_manifest(inputs: Sequence[str], manifest: str | Path) -> Sources:
    lines = read_manifest(manifest)
    labels = {line.file.resolve(): line.label for line in lines if line.file is not None}
    absent = [line.label for line in lines if line.file is None]
    if not inputs:
        named = [(str(line.file), line.label) for line in lines if line.file is not None]
        return Sources(tuple(named), (), tuple(absent), by_manifest=True)
    paths = {one: Path(one).resolve() for one in inputs}
    existing = set(paths.values())
    named = [(one, labels[path]) for one, path in paths.items() if path in labels]
    order = list(labels)
    named.sort(key=lambda pair: order.index(paths[pair[0]]))
    skipped = [one for one, path in paths.items() if path not in labels and path != Path(manifest).resolve()]
    unnamed = [Failure(one, f"{one}: {manifest} does not name it; add a row for it") for one in skipped]
    absent += [label for path, label in labels.items() if path not in existing]
    return Sources(tuple(named), tuple(unnamed), tuple(absent), by_manifest=True)


def _by_name(inputs: Sequence[str], pattern: str | None) -> Sources:
    names = None if pattern is None else Pattern(pattern)
    named: list[tuple[str, Label]] = []
    unnamed: list[Failure] = []
    stamps: dict[str, Stamp] = {}
    for one in inputs:
        try:
            if names is None:
                stamps[one] = stamp_before(one)
            label = recorded_label(Path(one)) if names is None else names.label(one)
        except RebaError as error:
            unnamed.append(Failure(one, str(error)))
            continue
        if label is not None:
            named.append((one, label))
        elif names is None:
            hint = "give --manifest FILE.csv or --pattern {participant}_{condition}"
            unnamed.append(Failure(one, f"{one}: no metadata record {RECORD!r}; {hint}"))
        else:
            unnamed.append(Failure(one, f"{one}: its name does not match {names.text}; rename it or give a manifest"))
    return Sources(tuple(named), tuple(unnamed), stamps=stamps)


def _check(named: Iterable[tuple[str, Label]]) -> None:
    """Refuse two recordings with the same label, and names that differ only in upper and lower case."""
    files: dict[tuple[str, str, str], str] = {}
    spelled: dict[tuple[str, str], str] = {}
    for file, label in named:
        key = (label.participant, label.condition, label.trial)
        if key in files:
            both = " and ".join(filter(None, (files[key], file))) or "two rows"
            raise LgpError(f"{label} is the label of {both}; give each a trial, or leave one out")
        files[key] = file
        for kind, name in (("participant", label.participant), ("condition", label.condition)):
            first = spelled.setdefault((kind, name.casefold()), name)
            if first != name:
                raise LgpError(f"{kind} is spelled {first!r} and {name!r}; use one spelling")
