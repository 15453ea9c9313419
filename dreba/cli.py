"""The `dreba` command: a placeholder until the package has something to run."""

import sys


def main() -> None:
    """Say that nothing is here yet and exit with 2, as any command that cannot do what was asked."""
    sys.stderr.write("dreba: this package holds no commands yet; `reba --help` lists what works today\n")
    raise SystemExit(2)
