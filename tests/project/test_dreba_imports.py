"""What importing `dreba` costs: NumPy and pandas, until a model is named."""

from __future__ import annotations

import json
import subprocess
import sys

HEAVY = {"sklearn", "scipy", "qpsolvers", "clarabel", "casadi", "plotly", "jinja2", "rich", "mcap", "joblib"}


def loaded(code: str) -> set[str]:
    report = "import json, sys; print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    done = subprocess.run([sys.executable, "-c", f"{code}; {report}"], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout))


def test_importing_loads_no_solver_and_no_learner() -> None:
    assert not loaded("import dreba, dreba.cli") & HEAVY


def test_a_model_loads_its_base_classes_only() -> None:
    found = loaded("import dreba; dreba.QuadraticModel")
    assert "sklearn" in found
    assert not found & {"qpsolvers", "clarabel", "casadi", "plotly", "jinja2", "rich", "mcap"}


def test_every_public_name_is_there() -> None:
    import dreba

    assert all(hasattr(dreba, name) for name in dreba.__all__)
    assert set(dreba.__all__) <= set(dir(dreba))
    assert not hasattr(dreba, "no_such_name")
    assert set(dreba.KINDS) == {"quadratic", "convex", "soft", "graduated", "net"}
