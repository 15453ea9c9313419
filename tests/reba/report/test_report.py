"""The HTML report: its content, safe and self-contained pages, gaps and ranges in plots."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from reba.errors import RebaError
from reba.method.scoring import SCORE_COLUMNS
from reba.posture.columns import BEST, INDEX
from reba.posture.columns import PARTS as BODY_PARTS
from reba.posture.skeleton import LIMBS, VIEWS, joints, stick_figure
from reba.posture.table import Quality, table_of
from reba.report import render, write_report
from reba.report.body_map import upper_shares
from reba.report.comparison import _TIMES, _figure, _rounded, _shares, compared_figures, differing
from reba.report.error_section import error_section
from reba.report.explorer import cursor_frames
from reba.report.findings import worst_intervals
from reba.report.labels import BODY, FACTORS, LEVEL_COLOURS, PARTS, RULES
from reba.report.page import Form
from reba.report.sections import unmeasured_rows
from reba.report.series import Curve, StepCurve, band, line, steps
from reba.report.summary import quality_grade, seconds_of_levels, summarise
from reba.scores import Scores
from tests.support.says import says

HOSTILE = '<script>alert("x")</script>&\'"'


def frames(n: int = 200, hz: float = 10.0, *, without: str = "wrist|neck_twist") -> pd.DataFrame:
    """Return a person who bends and raises the right arm again and again; columns that match `without` are absent."""
    time = np.arange(n) / hz
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * time / 7.0)
    data: dict[str, Any] = {"time": time}
    for number, name in enumerate(reba.COLUMNS):
        data[name] = (10 + 4 * number) * wave if "flexion" in name else 3.0 * wave
    return pd.DataFrame({name: values for name, values in data.items() if not re.search(without, name)})


def scored(data: pd.DataFrame, source: str = "work.csv", **quality: Any) -> Scores:
    table = table_of(data)
    known = dataclasses.replace(table.quality, **quality)
    return reba.score(dataclasses.replace(table, source=source, quality=known), load=6.0)


class _Page(HTMLParser):
    """Collects tags, attributes and text outside scripts and styles."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.policy = ""
        self.links: list[str] = []
        self.ids: list[str] = []
        self.words: list[str] = []
        self.data: dict[str, str] = {}
        self._inside = ""
        self._id = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if given.get("http-equiv") == "Content-Security-Policy":
            self.policy = str(given["content"])
        self.tags.append(tag)
        self.links += [str(given[name]) for name in ("src", "href", "action", "xlink:href") if name in given]
        self.ids += [str(given["id"])] if "id" in given else []
        if tag in ("script", "style"):
            self._inside = tag
            self._id = str(given.get("id", "")) if given.get("type") == "application/json" else ""

    def handle_endtag(self, tag: str) -> None:
        if tag == self._inside:
            self._inside = ""

    def handle_data(self, data: str) -> None:
        if not self._inside:
            self.words.append(data)
        elif self._id:
            self.data[self._id] = data

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(scope="module")
def page() -> _Page:
    one = scored(frames(), sha256="ab" * 32, messages=210, skipped=10, first_skipped="byte 676: too short")
    return _Page(render([one], command="reba score work.csv --load 6"))


def numbers(packed: str, kind: str = "<f8") -> np.ndarray[Any, Any]:
    """Return an array of the page."""
    return np.frombuffer(base64.b64decode(packed), kind)


def test_every_section_is_there(page: _Page) -> None:
    for words in (
        "Verdict", "Time at high part scores", "What would help most", "REBA, parts and angles over time", "What if",
        "Time per action level", "Contributions of the parts", "Worst intervals",
        "Angles", "Assumptions", "Data quality", "Method and limits", "Sources", "How to reproduce this report",
    ):  # fmt: skip
        assert words in page.text
    for words in ("ab" * 32, "byte 676: too short", "reba score work.csv --load 6", reba.__version__, "screening"):
        assert words in page.text


def test_headline_names_the_range_and_its_reason(page: _Page) -> None:
    one = scored(frames())
    ends = one.summary()["range"]
    assert ends["p90_low"] < ends["p90_high"]
    assert one.summary()["verdict"]["text"] in page.text
    assert f"90th percentile REBA {ends['p90_low']} to {ends['p90_high']}" in page.text
    assert "neck twist and the wrists were not measured" in page.text


def test_all_rules_factors_and_parts_are_named(page: _Page) -> None:
    for field in dataclasses.fields(reba.Rules):
        assert field.name in page.text
        assert RULES[field.name] in page.text
    assert set(FACTORS) == {field.name for field in dataclasses.fields(reba.Factors)}
    assert tuple(PARTS) == SCORE_COLUMNS[: len(PARTS)]
    assert set(BODY) == set(BODY_PARTS)
    assert all(title in page.text for title in (*PARTS.values(), *FACTORS.values()))


def test_assumed_and_given_factors_differ(page: _Page) -> None:
    assert "No neutral posture was subtracted" in page.text
    assert "Load [kg] 6 given" in page.text
    assert "Leg support bilateral assumed" in page.text
    assert "Activity: repeated" in page.text
    assert "derived from the movement" in page.text


def test_nothing_is_loaded(page: _Page) -> None:
    assert "default-src 'none'" in page.policy
    assert all(link.startswith("#") for link in page.links)
    assert not {"link", "iframe", "img", "object", "embed", "base", "form"} & set(page.tags)


def test_accessible_structure() -> None:
    html = render([scored(frames(), "a.csv"), scored(frames(60), "b.csv")])
    page = _Page(html)
    assert '<html lang="en">' in html
    assert len(page.ids) == len(set(page.ids))
    assert page.tags.count("h1") == 1
    assert page.tags.count("table") == page.tags.count("caption")
    assert all("aria-label=" in svg for svg in re.findall(r"<svg[^>]*>", html[: html.index("<script>")]))
    assert set(re.findall(r'aria-labelledby="([^"]+)"', html)) <= set(page.ids)


def test_text_from_files_is_escaped() -> None:
    one = scored(
        frames(30), HOSTILE.replace("/", "") + ".csv", warnings=(HOSTILE,), ended_abnormally=HOSTILE,
        first_skipped=HOSTILE, skipped=1, messages=30, time_source=HOSTILE, sha256=HOSTILE,
    )  # fmt: skip
    postures = dataclasses.replace(
        one.postures, topic=HOSTILE, profile=HOSTILE, recognised=HOSTILE, why_unmeasured={"neck_twist": HOSTILE},
        assumed=(HOSTILE,),
    )  # fmt: skip
    page = _Page(render([dataclasses.replace(one, postures=postures)], command=HOSTILE, names=True))
    assert page.tags.count("script") == 4
    assert page.tags.count("title") == 1
    assert page.text.count(HOSTILE) >= 9


def test_figures_cannot_end_their_script(page: _Page) -> None:
    assert sorted(page.data) == ["explorer-model", "r1-explorer", "r1-what-if"]
    for text in page.data.values():
        assert "<" not in text
        assert json.loads(text)


def test_folders_stay_out() -> None:
    html = render([scored(frames(20), "/data/jane.doe/private/lift.csv")])
    assert "lift.csv" in html
    assert "jane" not in html


def test_abnormal_end_stands_before_the_headline() -> None:
    text = _Page(render(scored(frames(20), ended_abnormally="cut at byte 81920"))).text
    assert text.index("The recording is truncated") < text.index("Verdict")
    assert "cut at byte 81920" in text


@pytest.mark.parametrize("count", [0, 1, 2])
def test_tiny_recordings(count: int) -> None:
    text = _Page(render([scored(frames(count))])).text
    assert ("contains no frames" in text) == (count == 0)
    assert ("only one frame" in text) == (count == 1)


def test_nothing_measured() -> None:
    empty = frames(50).assign(**dict.fromkeys(reba.COLUMNS, np.nan))
    page = _Page(render([reba.score(empty, activity="none")]))
    assert "90th percentile REBA 1 to 11" in page.text
    assert "No angle was measured" in page.text
    assert json.loads(page.data["r1-explorer"])["angles"] == []


@pytest.mark.parametrize("missing", ["neutral", "worst"])
def test_fills_are_named_and_the_range_stays(missing: Any) -> None:
    text = _Page(render([reba.score(frames(60), missing=missing)])).text
    assert "as requested" in text
    assert re.search(r"90th percentile REBA \d+ to \d+", text)


def test_gravity_sitting_and_columns_as_factors() -> None:
    data = frames(60).assign(
        support=["Sitting", "walking"] * 30, load=np.linspace(0, 12, 60), coupling_left=["poor", "good"] * 30
    )
    rules = reba.Rules().replace(upper_arm_reference="gravity", two_sides="left")
    text = _Page(render([reba.score(data, rules=rules)])).text
    assert "against the vertical" in text
    assert "0 to 12" in text or "0.0 to 12.0" in text
    assert "sitting 50 %" in text
    assert "left side" in text


def test_time_axes_of_two_recordings_agree() -> None:
    page = _Page(render([scored(frames(200), "a.csv"), scored(frames(50), "b.csv")]))
    ranges = [json.loads(page.data[f"r{i}-explorer"])["range"] for i in (1, 2)]
    assert ranges[0] == ranges[1]
    assert "Overview" in page.text


def test_no_line_crosses_a_gap() -> None:
    data = frames(400, without="^$")
    gap = (data["time"] > 10) & (data["time"] < 15)
    page = _Page(render([scored(data[~gap].reset_index(drop=True))]))
    data = json.loads(page.data["r1-explorer"])
    time, until = numbers(data["time"]), numbers(data["until"])
    assert not ((time < 10.2) & (until > 14.8)).any()
    assert data["gaps"] == [[10.0, 15.0]]
    with_next = np.abs(time[1:] - until[:-1]) < 1e-6
    assert (~with_next).sum() == 1, "only the gap parts two frames"
    assert "Grey areas are gaps" in page.text


def test_gaps_that_only_the_reader_knows_break_the_line() -> None:
    one = scored(frames(100, without="^$"), gaps=((4.95, 5.05),))
    record = summarise(one)
    points = steps(one, record.curves["reba"], record.gaps)
    assert points.last.sum() == 2
    assert points.x[points.last][0] == pytest.approx(4.9)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(1, 15), min_size=2, max_size=400), st.integers(3, 40))
def test_decimation_keeps_extremes_and_invents_nothing(values: list[int], buckets: int) -> None:
    n = len(values)
    one = reba.score(pd.DataFrame({"time": np.arange(n) * 0.1, "trunk_flexion": np.zeros(n)}), activity="none")
    score = np.array(values, float)
    points = steps(one, Curve(score, score, score), [], buckets)
    assert (np.diff(points.x) > 0).all()
    assert len(points.x) <= 6 * buckets
    assert np.array_equal(points.x, one.time[points.frame])
    assert score[points.frame].max() == score.max()
    assert score[points.frame].min() == score.min()
    assert points.until[-1] == pytest.approx(n * 0.1)


def test_lines_and_bands_end_where_their_last_value_ends() -> None:
    points = StepCurve(np.array([0.0, 1.0, 2.0, 5.0]), np.array([1.0, 2.0, 3.0, 6.0]), np.array([0, 0, 1, 1], bool),
                   np.arange(4))  # fmt: skip
    x, y = line(points, np.array([4.0, 5.0, 6.0, 7.0]), np.array([True, False, True, True]))
    np.testing.assert_array_equal(x, [0, 1, np.nan, 2, 3, np.nan, 5, 6])
    np.testing.assert_array_equal(y, [4, 4, np.nan, 6, 6, np.nan, 7, 7])
    x, y = band(points, np.full(4, 2.0), np.full(4, 8.0), np.array([False, True, True, False]))
    np.testing.assert_array_equal(x, [1, 2, 2, 3, 3, 2, 2, 1])
    np.testing.assert_array_equal(y, [8, 8, 8, 8, 2, 2, 2, 2])


@pytest.mark.parametrize("without", ["^$", "wrist|neck_twist"])
def test_an_hour_stays_small(without: str, tmp_path: Path) -> None:
    write_report([scored(frames(180_000, 50.0, without=without))], tmp_path / "hour.html")
    assert (tmp_path / "hour.html").stat().st_size < 1_000_000


def test_many_recordings_share_the_size_of_one() -> None:
    sizes = [len(render([scored(frames(9_000, 50.0), f"{i}.csv") for i in range(number)])) for number in (1, 6)]
    assert (sizes[1] - sizes[0]) / 5 < 180_000


def test_the_cursor_reaches_every_frame_of_a_worst_interval() -> None:
    one = scored(frames(40_000, 50.0))
    record = summarise(one)
    intervals = worst_intervals(record)
    reached = cursor_frames(record, intervals)
    assert len(reached) < 6000
    assert (np.diff(reached) > 0).all()
    for interval in intervals:
        inside = np.flatnonzero((one.time >= interval.start) & (one.time < interval.end))
        middle = one.frame_at(interval.time)
        assert set(inside[np.abs(inside - middle) < 100]) <= set(reached)


def test_the_page_has_the_angles_and_scores_of_the_frames() -> None:
    one = scored(frames(300))
    record = summarise(one)
    page = _Page(render(one))
    data = json.loads(page.data["r1-explorer"])
    rows = np.searchsorted(one.time, numbers(data["time"]))
    np.testing.assert_array_equal(one.time[rows], numbers(data["time"]))
    for angle in data["angles"]:
        np.testing.assert_allclose(numbers(angle["values"], "<i2") / 10, one.angles[rows, angle["column"]], atol=0.051)
    for part in data["parts"]:
        for end in ("low", "high"):
            packed = part[end] or part["low"]
            np.testing.assert_array_equal(numbers(packed, "u1"), getattr(record.ends, end)[part["name"]][rows])
    low, high = (numbers(data["totals"]["reba"][end], "u1") for end in ("low", "high"))
    np.testing.assert_array_equal(low, one.data["reba_low"].to_numpy(int)[rows])
    np.testing.assert_array_equal(high, one.data["reba_high"].to_numpy(int)[rows])


def test_unmeasured_parts_of_either_side_have_their_own_range() -> None:
    data = frames(200, without="_left$|shoulder_elevation")
    record = summarise(scored(data))
    rows = {row.part: row for row in unmeasured_rows(record)}
    assert [name for name in rows if "arm" in name] == ["Left upper arm", "Right upper arm", "Left lower arm"]
    assert rows["Left upper arm"].leaves == "1.0 to 6.0"
    right = [
        float(np.average(end["upper_arm_right"], weights=record.weights)) for end in (record.ends.low, record.ends.high)
    ]
    assert rows["Right upper arm"].leaves == f"{right[0]:.1f} to {right[1]:.1f}"
    assert "Left upper arm and right" not in render([scored(data)])


def test_a_single_frame_has_a_length() -> None:
    data = frames(30, 50.0, without="^$")
    data[list(reba.COLUMNS)] = 0.0
    data["trunk_flexion"] = np.where(np.arange(30) == 15, 70.0, 0.0)
    text = _Page(render([scored(data)])).text
    assert "0.30 to 0.32 s, 0.02 s long, at REBA" in text
    assert "0.0 s long" not in text


def test_a_recording_under_a_second_sustains_no_score() -> None:
    page = _Page(render([scored(frames(30, 50.0))]))
    assert "no score is sustained that long" in page.text
    assert "not known" not in page.text


def test_the_body_map_shows_the_time_in_the_upper_classes() -> None:
    data = frames(100, without="^$")
    data["trunk_flexion"], data["trunk_twist"] = 0.0, 0.0
    data.loc[:29, "trunk_flexion"] = 70.0
    shares = {one.name: one for one in upper_shares(summarise(scored(data)))}
    assert (shares["trunk"].least, shares["trunk"].low, shares["trunk"].high) == (
        4,
        pytest.approx(0.3),
        pytest.approx(0.3),
    )
    assert "trunk 30" in render(scored(data)).replace("\xa0", " ")
    assert [one.name for one in upper_shares(summarise(scored(frames(0))))] == []


def test_views_are_true_and_of_one_scale() -> None:
    """A bend straight forward is symmetric from the front, and no posture changes the scale."""
    angles = np.array([BEST[name] for name in reba.COLUMNS])
    lengths = set()
    for bend, arms in ((0.0, 0.0), (50.0, 0.0), (90.0, 170.0)):
        angles[INDEX["trunk_flexion"]] = bend
        for side in ("left", "right"):
            angles[INDEX[f"upper_arm_flexion_{side}"]] = arms
        views = stick_figure(angles, {}, "bent").split("<g transform")[1:]
        assert [title for title, _ in VIEWS] == [re.findall(r'class="view"[^>]*>([^<]+)', view)[0] for view in views]
        limb = r'<line class="limb [^"]*" x1="([\d.-]+)" y1="([\d.-]+)" x2="([\d.-]+)" y2="([\d.-]+)"'
        lines = [[float(x) for x in ends] for ends in re.findall(limb, views[-1])]
        middle = sum(x1 + x2 for x1, _, x2, _ in lines) / len(lines) / 2
        ends = {(round(x - middle, 0), round(y, 0)) for x1, y1, x2, y2 in lines for x, y in ((x1, y1), (x2, y2))}
        assert all((-x, y) in ends or (0.0 - x, y) in ends for x, y in ends)
        shank = next(line for line in lines if line[3] > 200)
        lengths.add(round(np.hypot(shank[0] - shank[2], shank[1] - shank[3])))
        drawn = np.array([[x1, y1] for x1, y1, _, _ in lines])
        assert (drawn >= 0).all()
        assert (drawn[:, 0] <= 180).all()
    assert len(lengths) == 1


def test_measurement_error_has_its_section_only_if_given() -> None:
    data = frames()
    assert "With measurement error" not in _Page(render(scored(data))).text
    scores = reba.score(data, error="inertial", load=4.0)
    page = _Page(render(scores))
    assert "With measurement error: inertial" in page.text
    assert "a choice:" in page.text
    assert "Morrow et al. 2017" in page.text
    section = error_section(summarise(scores))
    assert section is not None
    for _, shares in section.bars:
        assert sum(share for _, share in shares) == pytest.approx(1.0)
    assert [row.level for row in section.reached] == [4, 3, 2, 1]
    own = reba.score(data, error={"trunk_flexion": 4.0, "wrist_twist_left": {"sd": 3.0, "bias": -2.0}})
    section = error_section(summarise(own))
    assert section is not None
    assert {"wrist twist left", "wrist twist right"} <= {row.name for row in section.angles}
    assert len(section.bars) == 2, "unmeasured angles leave two ends"


def test_shares_of_levels_add_up() -> None:
    one = scored(frames(), "a.csv")
    record = summarise(one)
    for name in ("reba", "reba_left", "reba_right"):
        assert sum(seconds_of_levels(record, name).values()) == pytest.approx(record.seconds)
    shares = one.summary()["action_levels"]
    for level, seconds in seconds_of_levels(record, "reba").items():
        if level is not None:
            assert seconds / record.seconds == pytest.approx(shares[str(level)])


def test_grade_follows_its_rules() -> None:
    good = Quality(messages=1000)
    assert quality_grade(good, 1000, 40.0, 0.0, 0.0, 25.0).letter == "A"
    assert quality_grade(dataclasses.replace(good, warnings=("x",)), 1000, 40.0, 0.0, 0.0, 25.0).letter == "B"
    assert quality_grade(dataclasses.replace(good, ended_abnormally="cut"), 1000, 40.0, 0.0, 0.0, 25.0).letter == "C"
    assert quality_grade(dataclasses.replace(good, skipped=100), 900, 40.0, 10.0, 0.0, 25.0).letter == "D"
    assert quality_grade(good, 0, 0.0, 0.0, 0.0, float("nan")).letter == "D"


@pytest.mark.parametrize(
    ("name", "value", "joint", "axis", "sign"),
    [
        ("trunk_flexion", 60, "neck", 0, 1),
        ("trunk_side_bend", 40, "neck", 2, 1),
        ("trunk_twist", 40, "shoulder_right", 0, 1),
        ("neck_flexion", 40, "head", 0, 1),
        ("neck_twist", 40, "nose", 2, -1),
        ("upper_arm_flexion_left", 90, "elbow_left", 0, 1),
        ("upper_arm_abduction_left", 60, "elbow_left", 2, -1),
        ("upper_arm_abduction_right", 60, "elbow_right", 2, 1),
        ("shoulder_elevation_left", 20, "shoulder_left", 1, 1),
        ("lower_arm_flexion_right", 90, "wrist_right", 0, 1),
        ("wrist_flexion_right", 60, "hand_right", 2, -1),
        ("wrist_flexion_left", 60, "hand_left", 2, 1),
        ("knee_flexion_left", 90, "knee_left", 0, 1),
        ("knee_flexion_left", 90, "ankle_left", 1, 1),
    ],
)
def test_the_figure_moves_the_right_way(name: str, value: float, joint: str, axis: int, sign: int) -> None:
    angles = np.zeros(len(reba.COLUMNS))
    still = joints(angles)[joint][axis]
    angles[reba.COLUMNS.index(name)] = value
    assert sign * (joints(angles)[joint][axis] - still) > 0.01


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-170, 170), min_size=22, max_size=22))
def test_limbs_keep_their_length(angles: list[float]) -> None:
    still, moved = joints(np.zeros(22)), joints(np.array(angles))
    for limb, (a, b, _) in LIMBS.items():
        length = np.linalg.norm(still[a] - still[b])
        assert np.linalg.norm(moved[a] - moved[b]) == pytest.approx(length), limb


def test_unmeasured_limbs_are_dashed() -> None:
    html = render([scored(frames(60))])
    assert 'class="limb unmeasured"' in html
    assert 'class="limb unmeasured"' not in render([scored(frames(60, without="^$"))])


def test_dark_text_stands_out_from_every_colour() -> None:
    def luminance(colour: str) -> float:
        channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    for colour in LEVEL_COLOURS[:4]:
        assert (luminance(colour) + 0.05) / (luminance("#1b2430") + 0.05) > 4.5
    assert 1.05 / (luminance(LEVEL_COLOURS[4]) + 0.05) > 4.5


def test_the_file_is_complete_or_absent(tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    reba.write_report([scored(frames(20))], target)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert target.read_text(encoding="utf-8").rstrip().endswith("</html>")
    with pytest.raises(RebaError) as error:
        write_report(scored(frames(20)), target / "inside.html")
    says(error, target / "inside.html", "cannot be written", "choose another")
    with pytest.raises(RebaError) as error:
        write_report([], target)
    says(error, "at least one", "none was given")


def test_the_former_argument_order_is_deprecated(tmp_path: Path) -> None:
    one = scored(frames(20))
    with pytest.warns(DeprecationWarning, match=r"scores, path"):
        write_report(str(tmp_path / "old.html"), [one])  # type: ignore[arg-type]
    write_report([one], tmp_path / "new.html")
    assert (tmp_path / "old.html").read_bytes() == (tmp_path / "new.html").read_bytes()


def test_the_same_scores_give_the_same_bytes() -> None:
    one = scored(frames(60))
    assert render([one]) == render([one])


def test_importing_the_report_loads_no_plots() -> None:
    code = "import sys, reba.report; print([name for name in ('plotly', 'jinja2') if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_without_a_browser_there_is_no_pdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reba.report.pdf.find_browser", lambda: None)
    with pytest.raises(RebaError) as error:
        write_report(scored(frames(20)), tmp_path / "report.pdf")
    says(error, "no browser was found", "install Chromium", ".html")
    assert list(tmp_path.iterdir()) == []


def test_a_browser_that_prints_nothing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reba.report.pdf.find_browser", lambda: sys.executable)
    with pytest.raises(RebaError) as error:
        write_report(scored(frames(20)), tmp_path / "report.pdf")
    says(error, sys.executable, "printed nothing", ".html")


def test_what_the_assessor_writes_is_escaped() -> None:
    page = _Page(render(scored(frames(20)), form=Form(HOSTILE, HOSTILE, HOSTILE)))
    assert page.text.count(HOSTILE) == 3


def test_a_comparison_has_every_figure_with_what_is_open() -> None:
    """What is certain at each level and what is not determined add up to the whole of each recording."""
    a = summarise(scored(frames(120), "a.csv"))
    better = frames(120)
    better["trunk_flexion"] = 0.0
    b = summarise(scored(better, "b.csv"))
    rows = {row.name: row for row in compared_figures(a, b)}
    for place in ("first", "second"):
        levels = [
            getattr(row, place) for name, row in rows.items() if name.startswith("At ") or name == "Not determined"
        ]
        certain = [text.partition(" to ")[0] for text in levels]
        shares = [float(text.replace("<", "").removesuffix(" %")) for text in certain]
        assert sum(shares) == pytest.approx(100, abs=1.5)
    assert float(rows["Not determined"].first.removesuffix(" %")) > 0
    assert any(" to " in rows[f"At {name} risk"].first for name in ("low", "medium", "high"))
    ends = [one.summary["range"] for one in (a, b)]
    a_low, a_high, b_low, b_high = (round(one[f"mean_{end}"], 2) for one in ends for end in ("low", "high"))
    low, high = b_low - a_high, b_high - a_low
    assert low < 0 < high
    assert rows["REBA, mean"].change == f"−{-low:.2f} to +{high:.2f}"
    assert rows["REBA, mean"].better == 0, "the ranges overlap"
    assert rows["Trunk, mean score"].better == 1
    assert rows["At high risk"].change.endswith(" percentage points")
    assert "%" not in rows["At high risk"].change
    assert rows["Neck, mean score"].change == "0.00" or "to" in rows["Neck, mean score"].change
    text = _Page(render([a.scores, b.scores])).text
    assert "B minus A" in text
    assert compared_figures(a, summarise(scored(frames(0)))) == []


def test_fewer_seconds_of_a_shorter_recording_are_not_better() -> None:
    bent = frames(400, without="^$").assign(trunk_flexion=70.0, neck_flexion=40.0, knee_flexion_left=70.0)
    whole, part = (summarise(scored(bent[:n], f"{n}.csv")) for n in (400, 100))
    rows = {row.name: row for row in compared_figures(whole, part)}
    seconds = rows["Time at REBA 8 or more"]
    assert seconds.change.startswith("−")
    assert seconds.better == 0


@given(st.lists(st.integers(0, 1000).map(lambda share: share / 1000), min_size=4, max_size=4))
def test_a_difference_is_that_of_the_numbers_that_are_shown(shares: list[float]) -> None:
    a, b = sorted(shares[:2]), sorted(shares[2:])

    def numbers(text: str) -> list[float]:
        found = re.findall(r"[+−]?[0-9.]+", text)
        return [float(number.replace("−", "-")) for number in (found * 2)[:2]]

    for kind, factor in ((_shares(a, b), 1.0), (_rounded(2), 15.0), (_rounded(0), 15.0), (_TIMES, 50.0)):
        ends = [tuple(factor * end for end in one) for one in (a, b)]
        row = _figure("", *ends, kind)
        first, second, change = (numbers(text) for text in (row.first, row.second, row.change))
        assert change == pytest.approx([second[0] - first[1], second[1] - first[0]], abs=1e-6)


def test_what_makes_a_comparison_hard_is_said() -> None:
    a, b = (summarise(scored(frames(50, without=lacks), name)) for lacks, name in (("wrist", "a.csv"), ("^$", "b.csv")))
    assert list(differing(a, b)) == ["Not measured in a.csv only: the wrists."]


def test_recordings_that_failed_are_listed_without_their_folders() -> None:
    scores = reba.score({"trunk_flexion": [10.0, 70.0]}, missing="neutral")
    failed = [("/data/ann/broken.mcap", "/data/ann/broken.mcap: the magic number is missing; record it again")]
    text = render(scores, failed=failed)
    for words in (
        "Not scored",
        ">broken.mcap<",
        ">the magic number is missing; record it again<",
        "One recording could not",
    ):
        assert words in text
    assert "/data/ann" not in text
    assert "/data/ann" in render(scores, failed=failed, names=True)
    assert "Not scored" not in render(scores)


@pytest.mark.slow
def test_a_report_of_many_recordings_grows_little_with_each() -> None:
    rng = np.random.default_rng(0)
    columns = (
        "trunk_flexion",
        "upper_arm_flexion",
        "lower_arm_flexion",
        "neck_flexion",
        "knee_flexion",
        "wrist_flexion",
    )
    frames = {"time": np.arange(5000) / 25.0, **{name: rng.uniform(0.0, 80.0, 5000) for name in columns}}
    scores = reba.score(pd.DataFrame(frames))
    size = {number: len(render([scores] * number).encode()) for number in (4, 12)}
    assert (size[12] - size[4]) / 8 < 200_000
