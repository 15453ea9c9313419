"""The `lgp` command; interrupts are handled before its modules are imported."""

from __future__ import annotations

from reba.interrupts import enter


def main() -> None:
    """Run the command and exit; an error is one line on standard error."""
    enter("lgp.cli")


if __name__ == "__main__":
    main()
