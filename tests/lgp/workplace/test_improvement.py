"""`lgp.improve`: exact scores as the surface moves, on real and simulated recordings."""

import json
from dataclasses import replace

import numpy as np
import pytest

import lgp
import reba
from lgp.workplace.report import render
from lgp.workplace.wording import assumptions, move, nearness, result
from tests.support.paths import DATASETS
from tests.support.says import says

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scores():
    return reba.score(reba.read(DATASETS / "simulated_palletising.mcap"), load=8.0)


@pytest.fixture(scope="module")
def moved(scores):
    return lgp.improve(scores, at=28.8)


def test_scores_are_exact_and_the_place_as_it_is_scores_no_worse(scores, moved):
    (moment,) = moved.moments
    frame = scores.frame_at(28.8)
    assert moment.measured.reba == scores.data["reba"].iloc[frame]
    assert moment.measured.angles == pytest.approx(scores.angles[frame])
    assert moment.unchanged.reba <= moment.measured.reba
    assert moment.proposed.reba == min(
        place.posture.reba for row in (*moment.grid, moment.sideways) for place in row if place.posture is not None
    )
    activity = {
        kind: bool(np.atleast_1d(getattr(scores.factors, kind))[frame]) for kind in ("static", "repeated", "unstable")
    }
    for posture in (moment.unchanged, moment.proposed):
        again = reba.score_array(posture.angles[None], {"load": 8.0, **activity})
        assert int(again["reba"][0]) == posture.reba
        assert int(again["trunk"][0]) == posture.parts["trunk"]


def test_low_work_is_raised(moved):
    (moment,) = moved.moments
    assert moment.best.height > moment.here.height + 0.15
    assert moment.proposed.reba <= moment.unchanged.reba - 2
    assert "higher" in move(moment.best)
    says(result(moment, moved), f"REBA {moment.measured.reba}", f"REBA {moment.proposed.reba}", "higher")


def test_the_surface_goes_to_a_side_only_where_that_lowers_the_score(moved):
    (moment,) = moved.moments
    straight = min(place.posture.reba for row in moment.grid for place in row if place.posture is not None)
    assert moment.best.moved[1] == 0.0 or moment.proposed.reba < straight


def test_places_are_those_of_the_grid(moved):
    (moment,) = moved.moments
    heights = [row[0].height for row in moment.grid]
    assert heights == sorted(heights)
    assert np.diff(heights) == pytest.approx(0.1, abs=1e-9)
    assert sum(place.moved == (0.0, 0.0, 0.0) for row in moment.grid for place in row) == 1
    for row in moment.grid:
        for place in row:
            assert place.height - moment.here.height == pytest.approx(place.moved[2])
            assert place.distance - moment.here.distance == pytest.approx(place.moved[0])


def test_limits_of_the_surface_are_kept(scores):
    moment = lgp.improve(scores, at=28.8, heights=(0.9, 1.1), distances=(0.4, 0.5), hands="left").moments[0]
    others = [place for row in moment.grid for place in row if place.moved[2] != 0.0 and place.moved[0] != 0.0]
    assert others
    assert all(0.9 <= place.height <= 1.1 and 0.4 <= place.distance <= 0.5 for place in others)


def test_a_real_recording_whose_wrists_were_not_measured():
    scores = reba.score(reba.read(DATASETS / "balancing_keypoints.trc"))
    moment = lgp.improve(scores, heights=(0.8, 1.1), distances=(0.3, 0.5)).moments[0]
    unmeasured = np.isnan(moment.measured.angles)
    assert unmeasured.any()
    for posture in (moment.unchanged, moment.proposed):
        assert np.isnan(posture.angles).tolist() == unmeasured.tolist()
    assert moment.proposed.reba <= moment.unchanged.reba <= moment.measured.reba
    assert moment.fit[0] < 0.5


def test_how_near_the_body_comes_is_said_where_it_differs(moved):
    (moment,) = moved.moments
    near, far = (replace(moment, fit=fit) for fit in ((0.01, 0.04, "trunk flexion"), (0.5, 2.1, "neck twist")))
    assert nearness(near) == "The body has the measured angles."
    assert nearness(far).endswith("within 0.5 deg on average, 2.1 deg at most (neck twist).")


def test_the_worst_postures_by_default(scores):
    moved = lgp.improve(scores, heights=(0.9, 0.9), distances=(0.3, 0.3), step=0.3)
    assert len(moved.moments) == 3
    assert {moment.measured.reba for moment in moved.moments} == {11}
    json.dumps(moved.to_dict(), allow_nan=False)


def test_too_many_places_are_refused(scores):
    with pytest.raises(lgp.LgpError) as error:
        lgp.improve(scores, at=28.8, heights=(0.0, 3.0), distances=(0.0, 2.0), step=0.02)
    says(error, "places", "1000", "longer step")


def test_arms_that_were_not_measured_are_no_hands():
    scores = reba.score({"trunk_flexion": [60.0], "upper_arm_flexion_right": [60.0], "lower_arm_flexion_right": [20.0]})
    with pytest.raises(lgp.LgpError) as error:
        lgp.improve(scores, at=0.0, hands="left")
    says(error, "left arm", "not measured", "choose")
    small = {"heights": (0.9, 0.9), "distances": (0.3, 0.3), "step": 0.3}
    one_arm = lgp.improve(scores, at=0.0, **small)
    assert one_arm.moments[0].measured.reba > 1
    assert one_arm.person["hands"] == "right"
    says(" ".join(assumptions(one_arm)), "the right hand where it works")
    says(result(one_arm.moments[0], one_arm), "as measured, unmeasured angles neutral")
    with pytest.raises(lgp.LgpError) as error:
        lgp.improve(reba.score({"trunk_flexion": []}))
    says(error, "no frame")


def test_the_page_states_what_was_found(moved):
    text = render(moved, command="lgp improve shift.mcap")
    (moment,) = moved.moments
    for words in (
        result(moment, moved),
        "out of reach",
        "lgp improve shift.mcap",
        "soles on the floor",
        nearness(moment),
    ):
        assert words in text
    assert text.count("<svg") == 3
    assert text.count(">best<") == 2  # in the grid, and among the places to either side
    assert text.count(">now<") == 1
