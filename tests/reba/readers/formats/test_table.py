"""The table reader: posture tables and joint tables as CSV and Parquet, time columns, Vicon exports, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as arrow_csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reba
from reba.errors import ReadError
from reba.posture.columns import COLUMNS
from reba.readers.formats.table import open_table, sniff
from reba.readers.recording.stream import ReadLog, Recording, Stream
from tests.support.says import says

SMALL = """time,trunk_flexion,knee_flexion_left,support,shock,coupling_left,load
0.0,10.5,1,bilateral,True,good,3.5
0.1,20,,walking,False,poor,3.5
0.2,-5.25,3,sitting,False,good,
"""


def opened(folder: Path, text: str | bytes, name: str = "small.csv") -> Recording:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return open_table(path)


def whole(stream: Stream) -> pd.DataFrame:
    assert stream.table is not None
    return stream.table()


def times(recording: Recording) -> np.ndarray:
    return np.concatenate([block.time for block in recording.streams[0].blocks()])


def test_a_posture_table_keeps_its_angles_and_factors(tmp_path: Path) -> None:
    recording = opened(tmp_path, SMALL)
    (stream,) = recording.streams
    assert (recording.format, stream.kind, stream.unit, stream.count) == ("csv", "angles", "deg", 3)
    assert stream.names == ("trunk_flexion", "knee_flexion_left")
    log = ReadLog()
    (block,) = stream.blocks(log)
    np.testing.assert_array_equal(block.values, [[10.5, 1], [20, np.nan], [-5.25, 3]])
    assert (log.messages, log.skipped, log.warnings, log.time_source) == (3, 0, [], "column time")
    table = whole(stream)
    assert list(table.columns) == SMALL.splitlines()[0].split(",")
    assert table["support"].tolist() == ["bilateral", "walking", "sitting"]
    assert table["coupling_left"].tolist() == ["good", "poor", "good"]
    assert table["shock"].tolist() == [True, False, False]
    assert table["load"].isna().tolist() == [False, False, True]


@pytest.mark.parametrize(
    "text",
    [
        SMALL.replace("\n", "\r\n"),
        SMALL.replace("\n", "\r"),
        "\ufeff" + SMALL,
        SMALL.replace(",", "\t"),
        SMALL.replace(",", ";").replace(".", ","),
        SMALL.replace(",", "\t").replace(".", ","),
        "# made by hand\n\n" + SMALL,
        SMALL + "\n\n",
        SMALL.rstrip("\n"),
        SMALL.replace(",", ", "),
        SMALL.encode("utf-16"),
    ],
)
def test_writing_variants_give_the_same_table(tmp_path: Path, text: str | bytes) -> None:
    expected = whole(opened(tmp_path, SMALL).streams[0])
    recording = opened(tmp_path, text, "other.csv")
    pd.testing.assert_frame_equal(whole(recording.streams[0]), expected)
    assert recording.log.warnings == []


def test_parquet_keeps_types(tmp_path: Path) -> None:
    frame = whole(opened(tmp_path, SMALL).streams[0])
    frame["support"] = frame["support"].astype("category")
    frame["parts"] = [[1], [2, 3], []]
    frame.to_parquet(tmp_path / "small.parquet")
    recording = open_table(tmp_path / "small.parquet")
    (stream,) = recording.streams
    assert (recording.format, stream.kind, stream.count) == ("parquet", "angles", 3)
    table = whole(stream)
    assert table["support"].tolist() == ["bilateral", "walking", "sitting"]
    assert table["shock"].dtype == bool
    assert [(topic.name, topic.usable) for topic in recording.topics] == [("small", True), ("parts", False)]


def test_any_other_table_holds_joints(tmp_path: Path) -> None:
    text = "Time [s],left_knee_deg,hip_deg,who\n0,1.5,2,ann\n0.5,2.5,3,ann\n"
    recording = opened(tmp_path, text)
    (stream,) = recording.streams
    assert (stream.kind, stream.unit, stream.names, stream.table) == (
        "joints",
        "deg",
        ("left_knee_deg", "hip_deg"),
        None,
    )
    np.testing.assert_array_equal(times(recording), [0, 0.5])
    assert [(topic.name, topic.usable) for topic in recording.topics] == [("small", True), ("who", False)]
    assert opened(tmp_path, text.replace("_deg", "_rad")).streams[0].unit == "rad"
    assert opened(tmp_path, text.replace("_deg", "")).streams[0].unit == ""


@pytest.mark.parametrize(
    ("column", "first", "second", "step", "epoch"),
    [
        ("time", "0", "0.01", 0.01, 0.0),
        ("t", "5", "5.5", 0.5, 0.0),
        ("time_ms", "0", "10", 0.01, 0.0),
        ("Timestamp (ms)", "100", "110", 0.01, 0.0),
        ("time_ns", "0", "1000000", 0.001, 0.0),
        ("timestamp", "0", "10000000", 0.01, 0.0),
        ("timestamp", "0", "10000", 0.01, 0.0),
        ("timestamp", "1700000000.25", "1700000000.5", 0.25, 1700000000.25),
        ("timestamp", "1700000000250", "1700000000260", 0.01, 1700000000.25),
        ("header.stamp", "1700000000250000000", "1700000000250000001", 1e-9, 1700000000.25),
        ("stamp_us", "1700000000250000", "1700000000250001", 1e-6, 1700000000.25),
        ("time", "2023-11-14T22:13:20.25Z", "2023-11-14T22:13:20.260Z", 0.01, 1700000000.25),
    ],
)
def test_time_columns(tmp_path: Path, column: str, first: str, second: str, step: float, epoch: float) -> None:
    recording = opened(tmp_path, f"{column},trunk_flexion\n{first},1\n{second},2\n")
    found = times(recording)
    assert found[1] - found[0] == pytest.approx(step, rel=1e-6)
    assert recording.streams[0].epoch == pytest.approx(epoch)
    if epoch:
        assert found[0] == 0.0
    assert list(whole(recording.streams[0]).columns) == ["time", "trunk_flexion"]


@pytest.mark.parametrize("names", ["header.stamp.sec,header.stamp.nanosec", "sec,nanosec", "secs,nsecs"])
def test_ros_stamps_in_two_columns(tmp_path: Path, names: str) -> None:
    recording = opened(tmp_path, f"{names},knee\n1700000000,500000000,1\n1700000001,0,2\n")
    assert recording.streams[0].names == ("knee",)
    np.testing.assert_allclose(np.diff(times(recording)), 0.5)


def test_an_empty_time_column_needs_the_rate(tmp_path: Path) -> None:
    table = "timestamp,timestamp_by_camera,trunk_flexion\n,{},10\n,{},11\n"
    with pytest.raises(ReadError) as error:
        opened(tmp_path, table)
    says(error, "no row has a value", "timestamp", "--rate 30")
    assert times(open_table(tmp_path / "small.csv", rate=10.0)).tolist() == [0.0, 0.1]


def test_dates_in_parquet(tmp_path: Path) -> None:
    stamps = pd.to_datetime([1700000000_000000001, 1700000000_000000003], unit="ns", utc=True)
    pd.DataFrame({"timestamp": stamps, "knee": [1.0, 2.0]}).to_parquet(tmp_path / "a.parquet")
    recording = open_table(tmp_path / "a.parquet")
    np.testing.assert_allclose(times(recording), [0, 2e-9], rtol=1e-12)
    assert recording.streams[0].epoch == pytest.approx(1.7e9)


def test_what_is_odd_is_noted(tmp_path: Path) -> None:
    text = "time,trunk_flexion,trunk_twsit\n0,1,2\n,2,3\n0.2,3,4\n0.1,4,5\n"
    recording = opened(tmp_path, text)
    assert recording.streams[0].count == 3
    assert (recording.log.skipped, recording.log.first_skipped) == (1, "line 3: no time")
    assert any("did you mean 'trunk_twist'" in warning for warning in recording.log.warnings)
    assert any("time runs backwards" in warning for warning in recording.log.warnings)
    recording = opened(tmp_path, "time,knee,knee\n0,1,2\n10,2,3\n")
    assert recording.streams[0].names == ("knee", "knee_2")
    assert any("call it time_ms" in warning for warning in recording.log.warnings)
    recording = opened(tmp_path, "time,knee,größe\n0,1,2\n0.1,inf,3\n".encode("latin-1"))
    assert recording.streams[0].names == ("knee", "größe")
    assert np.isnan(next(recording.streams[0].blocks()).values[1, 0])
    assert len(recording.log.warnings) == 2


@pytest.mark.parametrize("name", ["twice.csv", "twice.parquet"])
def test_an_angle_or_a_factor_that_stands_twice_is_refused(tmp_path: Path, name: str) -> None:
    def write(columns: list[str]) -> None:
        data = pa.table([[0.0, 1.0]] * len(columns), names=columns)
        if name.endswith(".csv"):
            arrow_csv.write_csv(data, tmp_path / name)
        else:
            pq.write_table(data, tmp_path / name)

    for column in ("neck_twist", "load", "coupling"):
        write(["time", "neck_twist", "load", "coupling", column])
        with pytest.raises(ReadError) as error:
            open_table(tmp_path / name)
        says(error, repr(column), "2 times", "keep one")
    write(["time", "neck_twist", "speed", "speed"])
    assert open_table(tmp_path / name).streams[0].names == ("neck_twist",)


def test_a_truncated_last_line_is_left_out(tmp_path: Path) -> None:
    recording = opened(tmp_path, SMALL[:-20])
    assert recording.streams[0].count == 2
    assert recording.log.ended_abnormally is not None


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "the file is empty"),
        ("\n\n# only a comment\n", "no line with column names"),
        ("time,trunk_flexion\n", "the table has no rows"),
        ("trunk_flexion,knee\n1,2\n", "no time column among its 2 columns"),
        ("1,2,3\n4,5,6\n", "line 1 | expected column names"),
        ("time\n1\n", "line 1 has 1 column names"),
        ("time,trunk_flexion\n0,1\n0.1,x1\n", "line 3: 'x1' in column 'trunk_flexion' is not a number"),
        ("# c\n\ntime,knee\n0,1\n1,2\n2,3\n3,x1\n", "line 7: 'x1' in column 'knee' is not a number"),
        ("time,trunk_flexion\n0,inf\n", "line 2 | inf | 'trunk_flexion' | not an angle"),
        ("time,trunk_flexion\nsoon,1\n", "line 2: 'soon' in column 'time' is not a time"),
        ("time,trunk_flexion\n,1\n", "no row has a value in the time column"),
        ("time,trunk_flexion\n1e300,1\n", "1e+300 | not a time"),
        ("time,who\n0,ann\n", "no column | numbers | joint values or angles"),
        ("time,a,b\n0,1,2\n1,2,3,4,5\n", "line 3, saw 5"),
        (b"time,a\n0,\x00\n", "at byte 9: binary data"),
        (b"PAR1 and then nothing", "not a readable Parquet file"),
        (b"\xff\xfet\x00,", "damaged UTF-16 text"),
    ],
)
def test_damage_is_told(tmp_path: Path, text: str | bytes, what: str) -> None:
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, text)
    says(caught, *what.split(" | "))


@given(st.lists(st.lists(st.floats(-360, 360) | st.none(), min_size=3, max_size=3), min_size=1, max_size=8))
def test_numbers_survive_csv_and_parquet(tmp_path_factory: pytest.TempPathFactory, rows: list) -> None:
    folder = tmp_path_factory.mktemp("table")
    frame = pd.DataFrame(rows, columns=list(COLUMNS[:3]), dtype=float)
    frame.insert(0, "time", np.arange(len(rows)) / 100)
    frame.to_csv(folder / "a.csv", index=False)
    frame.to_parquet(folder / "a.parquet")
    for name, tolerance in (("a.csv", 1e-13), ("a.parquet", 0.0)):
        stream = open_table(folder / name).streams[0]
        found = np.concatenate([block.values for block in stream.blocks()])
        # The fast decimal parser of pandas may miss the last bits.
        np.testing.assert_allclose(found, frame[list(COLUMNS[:3])], rtol=tolerance, atol=tolerance)


def test_sniff_looks_at_the_content() -> None:
    assert sniff(Path("a"), b"PAR1\x00\x00")
    assert sniff(Path("a.txt"), SMALL.encode())
    assert sniff(Path("a.txt"), b"time;knee")
    assert sniff(Path("a.csv"), b"foo,bar\n1,2\n")
    assert sniff(Path("a.txt"), b"Trajectories,,,\n100\n")
    for head in (b"", b"foo,bar\n", b"HIERARCHY\nROOT a\n", b"<mvnx a='1,2'>", b"\x02\x50\x00\x01,time"):
        assert not sniff(Path("a.txt"), head)


def _as_excel_writes(frame: pd.DataFrame, thousands: bool = False) -> str:
    def cell(value: object) -> str:
        if not isinstance(value, float):
            return str(value)
        return (f"{value:,.3f}" if thousands else f"{value:.3f}").translate(str.maketrans(",.", ".,"))

    rows = [";".join(map(cell, row)) for row in frame.itertuples(index=False)]
    return "\r\n".join([";".join(frame.columns), *rows]) + "\r\n"


@pytest.mark.parametrize("first", ["", "sep=;\r\n", '"sep=;"\r\n', "SEP=;;;\r\n"])
@pytest.mark.parametrize("thousands", [False, True])
def test_decimal_commas_wherever_they_stand(tmp_path: Path, first: str, thousands: bool) -> None:
    n = 3000
    frame = pd.DataFrame(
        {
            "time": [f"2024-05-01T12:{at // 60 % 60:02d}:{at % 60:02d}.5" for at in range(n)],
            "trunk_flexion": np.linspace(0.0, 90.0, n),
            # Whole numbers in all that a look at the beginning sees.
            "neck_flexion": [*range(10)] * 299 + [0.5] * 10,
            "weight": np.linspace(990.0, 1010.0, n),
        },
        dtype=object,
    )
    recording = opened(tmp_path, first + _as_excel_writes(frame, thousands))
    table = whole(recording.streams[0])
    np.testing.assert_allclose(table["trunk_flexion"], np.linspace(0.0, 90.0, n), atol=5e-4)
    np.testing.assert_allclose(table["neck_flexion"].to_numpy()[-10:], 0.5)
    np.testing.assert_allclose(table["weight"], np.linspace(990.0, 1010.0, n), atol=5e-4)
    np.testing.assert_allclose(np.diff(times(recording)), 1.0)


def test_quoted_decimal_commas_between_commas(tmp_path: Path) -> None:
    table = whole(opened(tmp_path, 'time,trunk_flexion\n"0,0","12,5"\n"0,1","13,25"\n').streams[0])
    np.testing.assert_allclose(table["trunk_flexion"], [12.5, 13.25])
    # A thousand or a decimal: not for a program to decide.
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, 'time,trunk_flexion\n0,"1,234"\n1,"2,345"\n')
    says(caught, "line 2: '1,234' in column 'trunk_flexion' is not a number")


def test_decimal_points_and_commas_in_one_column_are_told(tmp_path: Path) -> None:
    text = "time;trunk_flexion\n0;12,5\n1;12.5\n"
    np.testing.assert_allclose(whole(opened(tmp_path, text).streams[0])["trunk_flexion"], [12.5, 12.5])
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, "time;trunk_flexion\n0;12,5\n1;12,5 deg\n")
    says(caught, "line 3", "'12,5 deg'", "not a number")


def test_thousands_beside_decimal_commas_are_refused(tmp_path: Path) -> None:
    rows = "".join(f"{900 + 50 * at};{at},5\n".replace("1000", "1.000").replace("1050", "1.050") for at in range(4))
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, f"time_ms;trunk_flexion\n{rows}")
    says(caught, "line 4: '1.000' in column 'time_ms'", "thousand", "without separators")
    # Without decimal commas beside it a point is one.
    recording = opened(tmp_path, "time;trunk_flexion\n1.000;5\n1.050;6\n")
    np.testing.assert_allclose(np.diff(times(recording)), 0.05)


def test_near_names_are_offered_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "small.csv"
    path.write_text(
        "time,trunk_flex,LeftKneeFlexion,neck_flexoin,heart_rate\n" + "".join(f"{at},1,2,3,4\n" for at in range(5))
    )
    with pytest.raises(reba.ProfileError) as caught:
        reba.read(path)
    says(
        caught, "'trunk_flex' (did you mean 'trunk_flexion'?)", "'LeftKneeFlexion' (did you mean 'knee_flexion_left'?)"
    )
    says(caught, "'neck_flexoin' (did you mean 'neck_flexion'?)", "rename them")
    assert "heart_rate' (" not in str(caught.value)
    path.write_text(path.read_text().replace("trunk_flex,", "trunk_flexion,"))
    warnings = [text for text in reba.read(path).quality.warnings if "did you mean" in text]
    assert len(warnings) == 1
    says(warnings[0], "LeftKneeFlexion", "neck_flexoin")


@pytest.mark.parametrize("seconds", [60.0, 86400.0])
def test_times_in_minutes_or_days_are_told(tmp_path: Path, seconds: float) -> None:
    rows = "".join(f"{at / 100 / seconds},{at}\n" for at in range(30))
    says(opened(tmp_path, "time,trunk_flexion\n" + rows).log.warnings[0], "'time' steps by", "give seconds")


@pytest.mark.parametrize("rate", [1, 30, 1000])
def test_seconds_are_seconds(tmp_path: Path, rate: int) -> None:
    rows = "".join(f"{at / rate},{at}\n" for at in range(30))
    assert opened(tmp_path, "time,trunk_flexion\n" + rows).log.warnings == []


@pytest.mark.parametrize(("header", "seconds"), [("Time (min)", 60.0), ("time [h]", 3600.0), ("time_min", 60.0)])
def test_minutes_and_hours_are_read(tmp_path: Path, header: str, seconds: float) -> None:
    rows = "".join(f"{at / seconds},{at}\n" for at in range(30))
    np.testing.assert_allclose(times(opened(tmp_path, f"{header},trunk_flexion\n" + rows)), np.arange(30), atol=1e-9)


def test_a_word_among_times_is_named_with_its_line(tmp_path: Path) -> None:
    rows = "".join(f"{at},{at}\n" for at in range(30))
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, "time,trunk_flexion\n" + rows + "mean,14.5\n")
    says(caught, "line 32", "'mean'", "not a time")


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (("08:00:00.0", "08:00:00.5", "08:00:01"), (0, 0.5, 1)),
        (("08:00:00,0", "08:00:00,5", "08:00:01,0"), (0, 0.5, 1)),
        (("23:59:59.5", "00:00:00.0", "00:00:00.5"), (0, 0.5, 1)),
        (("59:59.5", "60:00.0", "60:00.5"), (0, 0.5, 1)),
        (("01.03.2026 08:00:00,5", "01.03.2026 08:00:01,0", "01.03.2026 08:00:01,5"), (0, 0.5, 1)),
        (("2026/03/01 08:00:00", "2026/03/01 08:00:01", "2026/03/01 08:00:02"), (0, 1, 2)),
    ],
)
def test_times_of_day_and_other_dates_are_times(
    tmp_path: Path, cells: tuple[str, ...], expected: tuple[float, ...]
) -> None:
    rows = "".join(f"{cell};{index}\n" for index, cell in enumerate(cells))
    found = times(opened(tmp_path, "time;trunk_flexion\n" + rows))
    np.testing.assert_allclose(found - found[0], expected, atol=1e-9)


@pytest.mark.parametrize(
    "time", [pd.to_timedelta(np.arange(3.0), "s"), pd.date_range("2026-03-01", periods=3, freq="s")]
)
def test_durations_and_an_index_of_times_are_times(tmp_path: Path, time: pd.Index) -> None:
    path = tmp_path / "index.parquet"
    pd.DataFrame({"trunk_flexion": [1.0, 2.0, 3.0]}, index=time).to_parquet(path)
    np.testing.assert_allclose(times(open_table(path)), [0.0, 1.0, 2.0])


@pytest.mark.parametrize("word", ["-", "--", "..", "1.#IND", "n/a"])
def test_a_word_for_no_value_is_a_gap(tmp_path: Path, word: str) -> None:
    table = whole(opened(tmp_path, f"time,trunk_flexion\n0,1\n0.1,{word}\n0.2,3\n").streams[0])
    np.testing.assert_array_equal(table["trunk_flexion"], [1.0, np.nan, 3.0])
