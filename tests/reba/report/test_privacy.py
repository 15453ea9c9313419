"""No subject, marker set, stream or folder on a page unless asked for."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import reba
from reba.cli import cli
from reba.readers.recording.profile import find_profile
from reba.report import render
from reba.report.privacy import WITH_NAMES, WITHOUT_NAMES, command_without_names
from tests.support.c3d_bytes import c3d_bytes
from tests.support.invoke import invoke
from tests.support.mvnx_text import mvnx_text
from tests.support.paths import DATASETS

sys.path.insert(0, str(DATASETS))

from ros2_bag import Ros2Bag
from ros2_messages import Transform

PERSON, OTHER = "JaneMiller", "TomSmith"


def keypoints() -> tuple[list[str], np.ndarray]:
    """Return the names of the keypoints of a person and their places (n, k, 3) [m]."""
    lines = (DATASETS / "balancing_keypoints.trc").read_text(encoding="utf-8").splitlines()
    names = [name for name in lines[3].split("\t")[2:] if name]
    rows = np.array([[float(cell) for cell in line.split("\t")[2:]] for line in lines[6:] if line.strip()])
    return names, rows[:, : 3 * len(names)].reshape(len(rows), -1, 3)


def c3d(folder: Path) -> Path:
    names, points = keypoints()
    labels = [f"{person}:{name}" for person in (PERSON, OTHER) for name in names]
    path = folder / "trial.c3d"
    both = np.concatenate([points, points + np.array([1.0, 0.0, 0.0])], axis=1)
    path.write_bytes(c3d_bytes(labels, 1000.0 * both))
    return path


def trc(folder: Path) -> Path:
    lines = (DATASETS / "balancing_keypoints.trc").read_text(encoding="utf-8").splitlines()
    head = lines[3].split("\t")
    lines[0] = lines[0].rsplit("\t", 1)[0] + f"\t/home/{PERSON}/trial.trc"
    lines[3] = "\t".join(name if at < 2 or not name else f"{PERSON}:{name}" for at, name in enumerate(head))
    lines[3] = lines[3].replace(f"{PERSON}:mouth_left", f"{OTHER}:mouth_left")
    path = folder / "trial.trc"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def mvnx(folder: Path) -> Path:
    n = 30
    rest = np.tile([1.0, 0.0, 0.0, 0.0], (n, 23, 1))
    places, angles = np.zeros((n, 23, 3)), np.zeros((n, 22, 3))
    angles[:, 0, 2] = np.linspace(0.0, 40.0, n)
    text = mvnx_text(rest, places, angles, np.zeros((n, 6, 3)))
    path = folder / "trial.mvnx"
    path.write_text(
        text.replace('label="Suit 1"', f'label="{PERSON}"').replace("a.mvn", f"{PERSON}.mvn"), encoding="utf-8"
    )
    return path


def bag(folder: Path) -> Ros2Bag:
    return Ros2Bag(folder / "trial.mcap", "test")


def joint_states(folder: Path) -> Path:
    """Write joint states whose topic and joints have the names of two people."""
    names = reba.read(DATASETS / "simulated_palletising.mcap").signals
    with bag(folder) as file:
        for at in range(60):
            for person in (PERSON, OTHER):
                joints = [f"{person}/{name}" for name in names]
                file.joints(
                    f"/{PERSON}/joint_states", at * 50_000_000, joints, np.sin(at / 9.0 + np.arange(len(names)))
                )
    return folder / "trial.mcap"


def transforms(folder: Path) -> Path:
    """Write the segments of a person, whose frames have the name of the person."""
    with bag(folder) as file:
        for at in range(60):
            half = np.sin(at / 9.0) / 4.0
            pose = (0.0, 0.0, 1.0, 0.0, np.sin(half), 0.0, np.cos(half))
            every = [
                Transform("world", f"{PERSON}/{name}", pose) for (name,) in find_profile("human_frames").slots.values()
            ]
            file.transforms("/tf", at * 50_000_000, every)
    return folder / "trial.mcap"


WRITERS = {"c3d": c3d, "trc": trc, "mvnx": mvnx, "transforms": transforms, "joint states": joint_states}


@pytest.mark.parametrize("kind", WRITERS)
def test_names_are_shown_only_where_asked_for(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / f"{PERSON}-files"
    folder.mkdir()
    path = WRITERS[kind](folder)
    # A recording of one subject has its stream by the name of the file.
    named = {"topic": PERSON} if kind in ("c3d", "trc", "joint states") else {}
    postures = reba.read(path, **named)
    command = f"reba score {path} {'--topic ' + PERSON if named else ''} --report {folder / 'report.html'}"
    hidden, shown = (render(reba.score(postures), command=command, names=names) for names in (False, True))
    for text in (PERSON, OTHER, str(tmp_path)):
        assert text not in hidden, hidden[max(hidden.index(text) - 200, 0) : hidden.index(text) + 100]
    assert PERSON in shown
    assert path.name in hidden
    assert WITHOUT_NAMES[:60] in hidden
    assert WITH_NAMES[:60] in shown


def test_a_file_of_scores_keeps_its_names_to_itself(tmp_path: Path) -> None:
    scores = reba.score(reba.read(c3d(tmp_path), topic=PERSON))
    path = tmp_path / "scores.parquet"
    reba.write_scores(scores, path)
    text = render(reba.read_scores(path))
    assert PERSON not in text
    assert "scores.parquet" in text


def test_words_of_the_readers_are_no_names(tmp_path: Path) -> None:
    path = tmp_path / "trial.trc"
    shutil.copy(DATASETS / "balancing_keypoints.trc", path)
    text = render(reba.score(reba.read(path)))
    assert "[name 1]" not in text
    assert "points of profile" in text


def test_commands_lose_folders_and_names() -> None:
    scores = reba.score({"trunk_flexion": [10.0]})
    text = command_without_names(
        "reba score '/data/ann lee/a b.c3d' --report=/tmp/r.html --load 8 -o C:\\x\\s.csv", [scores]
    )
    assert text == "reba score 'a b.c3d' --report=r.html --load 8 -o C:xs.csv"
    assert command_without_names("reba 'score", [scores]) == ""


def test_the_option_of_the_command(tmp_path: Path) -> None:
    path, report = c3d(tmp_path), tmp_path / "report.html"
    words = ["score", str(path), "--topic", PERSON, "--report", str(report)]
    assert invoke(cli, words).exit_code == 0
    assert PERSON not in report.read_text(encoding="utf-8")
    assert invoke(cli, [*words, "--names"]).exit_code == 0
    assert PERSON in report.read_text(encoding="utf-8")
