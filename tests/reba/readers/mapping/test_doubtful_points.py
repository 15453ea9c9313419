"""Points that are no body in space: in one plane, in shares of an image, or with sides exchanged for a while."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from tests.support.paths import DATASETS
from tests.support.says import says

N = 300


def keypoints() -> tuple[list[str], np.ndarray]:
    """Return the names and places (n, k, 3) [m] of a recorded movement."""
    lines = (DATASETS / "balancing_keypoints.trc").read_text().splitlines()
    names = lines[3].split("\t")[2::3]
    names = [name for name in names if name]
    rows = np.array([[float(cell) for cell in line.split("\t")] for line in lines[5:] if line.strip()])
    places = rows[:, 2:].reshape(len(rows), len(names), 3)
    return names, np.concatenate([places, places[::-1]] * 2)[:N]


def warnings_of(path: Path, places: np.ndarray, names: list[str]) -> str:
    columns = {f"{name}_{axis}": places[:, at, k] for at, name in enumerate(names) for k, axis in enumerate("xyz")}
    pd.DataFrame({"time": np.arange(len(places)) / 60, **columns}).to_csv(path, index=False)
    return "\n".join(reba.read(path).quality.warnings)


@pytest.mark.parametrize("third", ["zero", "confidence"])
@pytest.mark.parametrize("scale", [1.0, 400.0])
def test_points_in_a_plane_are_told(tmp_path: Path, third: str, scale: float) -> None:
    names, places = keypoints()
    image = scale * np.stack([places[..., 1], -places[..., 2], 0 * places[..., 0]], axis=-1)
    image[..., 2] = 0.0 if third == "zero" else 1.0 - 1e-3 * np.arange(N)[:, None] / N
    assert "one plane" in warnings_of(tmp_path / "flat.csv", image, names)


def test_shares_of_an_image_are_told(tmp_path: Path) -> None:
    names, places = keypoints()
    image = np.stack([0.5 + 0.3 * places[..., 1], 0.9 - 0.45 * places[..., 2], -0.3 * places[..., 0]], axis=-1)
    assert "between 0 and 1" in warnings_of(tmp_path / "image.csv", image, names)


def test_sides_that_are_exchanged_for_a_while_are_told(tmp_path: Path) -> None:
    names, places = keypoints()
    other = [names.index(name.replace("left", "?").replace("right", "left").replace("?", "right")) for name in names]
    places[100:150] = places[100:150][:, other]
    found = re.search(r"exchanged in (\d+) of 300 frames", warnings_of(tmp_path / "swapped.csv", places, names))
    assert found is not None
    assert 40 <= int(found[1]) <= 50  # in two frames the feet point sideways


def test_a_body_in_space_is_not_doubted(tmp_path: Path) -> None:
    names, places = keypoints()
    text = warnings_of(tmp_path / "body.csv", places, names)
    assert not any(word in text for word in ("plane", "between 0 and 1", "exchanged"))


def test_points_without_depth_are_named(tmp_path: Path) -> None:
    names, places = keypoints()
    columns = {f"{name}_{axis}": places[:, at, k] for at, name in enumerate(names) for k, axis in enumerate("xy")}
    pd.DataFrame({"time": np.arange(N) / 60, **columns}).to_csv(tmp_path / "pixels.csv", index=False)
    with pytest.raises(reba.RebaError) as caught:
        reba.read(tmp_path / "pixels.csv")
    says(caught, "x and y", "no z", "3D")
