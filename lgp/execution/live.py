"""A run with its page: written if it is not there, served while the run goes on, changed when the plan is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lgp.execution.events import Event
from lgp.execution.server import HOST, PageServer
from lgp.execution.session import Run, Session
from lgp.plan_record import Plan

PAGE = "page"
"""Folder of the page, in that of its plan."""
PORT = 8642
"""Where the page is served unless another port is asked for."""


@dataclass(frozen=True)
class Address:
    """Where the page is served."""

    host: str = HOST
    port: int = PORT


def run_live(
    folder: Path,
    run: Run,
    told: Callable[[Event], None] | None = None,
    address: Address | None = None,
    served: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run the plan in a folder and return what happened, see `Session.go`.

    Args:
        folder: with the plan; log, page and new plans go there.
        run: how it is run.
        told: is called with every event.
        address: of the page; None for no page.
        served: is called with the page's address.

    Raises:
        LgpError: the plan cannot be run, or the page not be served.
    """
    servers: list[PageServer] = []

    def planned(plan: Plan, where: Path) -> None:
        # The first plan's page is there before the server is.
        if servers:
            servers[0].show(_page(plan, where))

    session = Session(folder, run, told, planned)
    if address is None:
        return session.go()
    try:
        server = PageServer(_page(session.planner.plan, session.where), session.hub, address.host, address.port)
    except BaseException:
        session.close()
        raise
    with server:
        servers.append(server)
        if served is not None:
            served(server.address)
        return session.go()


def _page(plan: Plan, where: Path) -> Path:
    """Return the folder of a plan's page, which is written if it is not there."""
    from lgp.page import write_page

    folder = where / PAGE
    if not (folder / "index.html").is_file():
        write_page(plan, folder, pictures=False)
    return folder
