"""Check the licences of the installed packages against docs/licences.toml, and write the table of the README.

python docs/licences.py            writes the table between its two marks; exit code 1 if a licence is not allowed
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
POLICY = tomllib.loads((ROOT / "docs" / "licences.toml").read_text(encoding="utf-8"))
MARKS = "<!-- licences -->", "<!-- end of licences -->"


def licence_of(found: Distribution, policy: dict[str, Any] = POLICY) -> list[str]:
    """Names of the licences that the metadata of a package states, as SPDX writes them; empty if it states none."""
    name, metadata = canonicalize_name(found.name), found.metadata
    if name in policy["stated"]:
        return [policy["stated"][name]]
    if expression := metadata.get("License-Expression"):
        return sorted(set(re.findall(r"[\w.+-]+", expression)) - {"AND", "OR", "WITH"})
    classifiers = [one.split(" :: ")[-1] for one in metadata.get_all("Classifier") or [] if one.startswith("License")]
    words = [one for one in classifiers if one != "OSI Approved"] or [(metadata.get("License") or "").split("\n")[0]]
    return sorted({policy["names"].get(one, one) for one in words if one})


def requirements(extra: str) -> Iterator[Requirement]:
    """Direct requirements of an extra, those of the extras that it includes left out; of no extra for ''."""
    for text in PROJECT["optional-dependencies"][extra] if extra else PROJECT["dependencies"]:
        requirement = Requirement(text)
        if requirement.name != PROJECT["name"]:
            yield requirement


def brought_by(wanted: Iterable[Requirement]) -> dict[str, Distribution]:
    """Installed packages that requirements bring, directly or through others, by canonical name."""
    found: dict[str, Distribution] = {}
    waiting = [(one, "") for one in wanted]
    seen = set()
    while waiting:
        requirement, extra = waiting.pop()
        key = canonicalize_name(requirement.name), frozenset(requirement.extras)
        if (requirement.marker and not requirement.marker.evaluate({"extra": extra})) or key in seen:
            continue
        seen.add(key)
        try:
            found[key[0]] = distribution(requirement.name)
        except PackageNotFoundError:
            continue
        for text in found[key[0]].requires or []:
            waiting += [(Requirement(text), one) for one in ("", *requirement.extras)]
    return found


def not_allowed(packages: dict[str, Distribution], policy: dict[str, Any] = POLICY) -> list[str]:
    """Lines that name the packages whose licence is neither allowed nor an exception with a reason."""
    wrong = []
    for name, found in sorted(packages.items()):
        excepted = policy["exceptions"].get(name, {}).get("licence")
        names = licence_of(found, policy)
        if not names or set(names) - {*policy["allowed"], excepted}:
            wrong.append(f"{name} {found.version}: licence {' AND '.join(names) or 'not stated'}")
    return wrong


def shipped() -> dict[str, Distribution]:
    """Installed packages that `pip install 'dreba[all]'` brings, by canonical name."""
    extras = [extra for extra in PROJECT["optional-dependencies"] if extra not in ("docs", "dev")]
    return brought_by(one for extra in ("", *extras) for one in requirements(extra))


def direct() -> dict[str, list[str]]:
    """Canonical names of the direct dependencies of each extra that has some."""
    names = {
        extra: sorted({canonicalize_name(one.name) for one in requirements(extra)})
        for extra in ("", *PROJECT["optional-dependencies"])
    }
    return {extra: found for extra, found in names.items() if found}


def rows(text: str) -> dict[str, list[str]]:
    """What `direct` returns, read from a table of the README."""
    found = re.findall(r"^\| (none|`[\w-]+`) \| (.*) \|$", text, flags=re.MULTILINE)
    return {extra.strip("`").replace("none", ""): re.findall(r"([\w-]+) \(", cell) for extra, cell in found}


def table(packages: dict[str, Distribution]) -> str:
    """Direct dependencies of each extra with their licences, and the exceptions among the packages of `all`."""
    lines = ["| Extra | Direct dependencies |", "|---|---|"]
    for extra, names in direct().items():
        cells = [f"{name} ({', '.join(licence_of(distribution(name)))})" for name in names]
        lines.append(f"| {f'`{extra}`' if extra else 'none'} | {', '.join(cells)} |")
    others = [f"{name} ({one['licence']})" for name, one in POLICY["exceptions"].items() if name in packages]
    return "\n".join([*lines, "", f"Copyleft among all that `dreba[all]` brings: {', '.join(others)}."])


def main() -> int:
    packages = shipped()
    wrong = not_allowed(packages)
    print(*wrong, sep="\n", end="\n" if wrong else "")
    readme = ROOT / "README.md"
    before, rest = readme.read_text(encoding="utf-8").split(MARKS[0])
    after = rest.split(MARKS[1])[1]
    readme.write_text(f"{before}{MARKS[0]}\n{table(packages)}\n{MARKS[1]}{after}", encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
