"""What importing costs, which way imports point, and that importing does nothing else."""

from __future__ import annotations

import ast
import importlib.util
import json
import subprocess
import sys

import pytest

from tests.support.paths import ROOT

MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in ("reba", "dreba", "lgp")
    for path in (ROOT / package).rglob("*.py")
    if path.name != "__main__.py"
)
HEAVY = {
    "sklearn", "qpsolvers", "mcap", "pinocchio", "scipy", "pyarrow", "plotly", "matplotlib", "jinja2", "typer", "rich",
    "joblib", "ezc3d", "orjson",
}  # fmt: skip
FORBIDDEN = {"reba": {"dreba", "lgp"}, "dreba": {"lgp"}, "lgp": set()}


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_importing_reba_loads_nothing_heavy() -> None:
    """Only what pandas loads by itself is allowed."""
    code = "import json, sys, {}; print(json.dumps(sorted({{name.split('.')[0] for name in sys.modules}})))"
    loaded, base = (set(json.loads(run(code.format(name)))) for name in ("reba", "pandas"))
    assert not (loaded - base) & HEAVY
    assert not loaded & (HEAVY - {"pyarrow"})


@pytest.mark.parametrize("package", ["reba", "dreba", "lgp"])
def test_imports_point_one_way(package: str) -> None:
    found = []
    for path in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or ""]
            wrong = [name for name in names if name.split(".")[0] in FORBIDDEN[package]]
            found += [f"{path.relative_to(ROOT)} imports {name}" for name in wrong]
    assert found == []


def test_importing_any_module_prints_and_writes_nothing() -> None:
    """Every module is imported in one fresh process; connections, processes and written files are reported."""
    wanted = [name for name in MODULES if importlib.util.find_spec(name) is not None]
    code = f"""
import importlib, sys
wrong, missing = [], []
watch = [False]
def hook(event, args):
    if watch[0] and (event.startswith("socket.") or event in ("subprocess.Popen", "os.system")):
        wrong.append((event, str(args[:1])))
    if watch[0] and event == "open" and isinstance(args[1], str) and args[1].strip("rbtU"):
        wrong.append((event, str(args[0])))
sys.addaudithook(hook)
import pandas
for name in {wanted!r}:
    watch[0] = True
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name.split(".")[0] in ("reba", "dreba", "lgp"):
            raise
        missing.append(error.name)
    watch[0] = False
assert not wrong, wrong
"""
    assert run(code) == ""
