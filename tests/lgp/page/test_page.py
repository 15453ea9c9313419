"""The page of a plan as files: ribbon, completeness, reproducibility, errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.errors import LgpError
from lgp.execution.server import Address, run_live
from lgp.execution.session import RunOptions
from lgp.page.page import check_packages, is_page_of, score_spans, write_page
from lgp.scene.scene_file import read_scene
from reba.extras import MissingPackageError
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.page_packages import needs_page
from tests.support.says import says

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan() -> lgp.Plan:
    return lgp.plan(read_scene(HUMAN_ONLY, "box"), cost=None, slices=4, collisions=False)


@pytest.fixture(scope="module")
def page(plan: lgp.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(plan, tmp_path_factory.mktemp("page")).parent


def test_the_ribbon_holds_every_true_score(plan: lgp.Plan) -> None:
    posture = plan.posture.copy()
    posture[1:3, 0] = 50.0  # bent forward for two slices
    bent = replace(plan, people={"human": replace(plan.people["human"], angles=posture)})
    ribbon = score_spans(bent)["human"]
    scores = bent.reba()
    assert scores is not None
    time = np.concatenate([[0.0], plan.time])
    assert ribbon[0].start == 0.0
    assert ribbon[-1].end == pytest.approx(plan.time[-1])
    assert [run.end for run in ribbon[:-1]] == [run.start for run in ribbon[1:]]
    assert len(ribbon) >= 3
    for number, score in enumerate(np.asarray(scores.reba, dtype=int)):
        middle = (time[number] + time[number + 1]) / 2.0
        assert [run.score for run in ribbon if run.start < middle < run.end] == [score]
    assert score_spans(replace(plan, people={})) == {}


@needs_page
def test_the_title_has_the_words_of_the_file_in_their_order(plan: lgp.Plan, tmp_path: Path) -> None:
    scene = replace(plan.scene, name="shelf_to_top_left")
    text = write_page(replace(plan, scene=scene), tmp_path).read_text()
    assert "<title>Shelf to top left</title>" in text


@needs_page
def test_the_same_plan_gives_the_same_files(plan: lgp.Plan, page: Path, tmp_path: Path) -> None:
    again = write_page(plan, tmp_path).parent
    files = {file.relative_to(page): file.read_bytes() for file in sorted(page.rglob("*")) if file.is_file()}
    assert files == {file.relative_to(again): file.read_bytes() for file in sorted(again.rglob("*")) if file.is_file()}
    assert sum(map(len, files.values())) < 10e6
    names = {str(name) for name in files}
    assert {"index.html", "pictures/start.webp", "pictures/action-1.webp", "pictures/action-1-film.webp"} <= names


@needs_page
def test_a_page_is_of_one_plan(plan: lgp.Plan, page: Path, tmp_path: Path) -> None:
    plan.save(tmp_path)
    assert is_page_of(plan, page)
    assert is_page_of(lgp.Plan.load(tmp_path), page)
    assert not is_page_of(replace(plan, path=plan.path + 1e-12), page)
    assert not is_page_of(replace(plan, actions=("wait(1)",)), page)
    assert not is_page_of(plan, tmp_path)


@needs_page
def test_a_run_never_shows_the_page_of_a_former_plan(plan: lgp.Plan, tmp_path: Path) -> None:
    pytest.importorskip("uvicorn", reason="uvicorn is not installed")
    write_page(replace(plan, path=plan.path + 1e-12), tmp_path / "page", pictures=False)
    plan.save(tmp_path)
    run_live(tmp_path, RunOptions(speed=0.0, compare=False), address=Address(port=0))
    assert is_page_of(plan, tmp_path / "page")


@needs_page
def test_nothing_is_asked_from_elsewhere(page: Path) -> None:
    own = ["index.html", "assets/page.css", "assets/stage.js", "assets/player.js", "assets/live.js"]
    for name in own:
        text = (page / name).read_text(encoding="utf-8")
        assert "http://" not in text
        assert "https://" not in text
        assert "import " not in text.replace("!important", "")


def test_a_missing_package_is_one_line() -> None:
    with pytest.raises(MissingPackageError) as error:
        check_packages({"no_such_module": "such-package"})
    says(error, "such-package", 'pip install "dreba[page]"')


@needs_page
def test_a_plan_that_is_none_has_no_page(plan: lgp.Plan, tmp_path: Path) -> None:
    with pytest.raises(LgpError) as error:
        write_page(replace(plan, feasible=False, reason="out of reach"), tmp_path / "page")
    says(error, "box", "feasible", "out of reach")
    (tmp_path / "file").write_text("")
    with pytest.raises(LgpError) as error:
        write_page(plan, tmp_path / "file" / "page", pictures=False)
    says(error, tmp_path / "file" / "page", "another folder")
