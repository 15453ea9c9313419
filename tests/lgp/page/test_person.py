"""The meshes of the person."""

from __future__ import annotations

import numpy as np
import pytest

from reba.posture import columns as columns_
from tests.support.page_packages import needs_page

pytestmark = pytest.mark.slow


@needs_page
def test_a_person_stands_on_the_floor_and_is_as_tall_as_said() -> None:
    import pinocchio as pin

    from lgp.kinematics import human
    from lgp.page.person import figure

    stature, sex = 1.55, "female"
    shape = figure(stature, sex)
    np.testing.assert_allclose(shape.skin.weight.sum(axis=1), 1.0)
    model = human.human_model(stature, sex)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    place = {name: data.oMi[number] for number, name in enumerate(model.names)}
    tops = {joint: mesh.vertices @ place[joint].rotation.T + place[joint].translation for joint, mesh in shape.parts}
    assert tops["middle_cervical_Y"][:, 2].max() == pytest.approx(stature, abs=0.06)
    for side in columns_.SIDES:
        assert tops[f"{side}_ankle_X"][:, 2].min() == pytest.approx(0.0, abs=0.01)
    left, right = (next(mesh for joint, mesh in shape.parts if joint == f"{side}_wrist_X") for side in columns_.SIDES)
    np.testing.assert_allclose(left.vertices * (1, 1, -1), right.vertices, atol=1e-12)
