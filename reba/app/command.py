"""`reba app`."""

from __future__ import annotations

import webbrowser

import click

from reba.command_line import Command, echo


@click.command("app", cls=Command, epilog="Example: reba app, then drop recordings on the page")
@click.option("--port", default=0, type=click.IntRange(0, 65535), show_default=True, help="0: any free one.")
@click.option("--browser/--no-browser", default=True, help="Open the page in the browser of this computer.")
def app_command(port: int, browser: bool) -> None:
    """Score recordings by drag and drop in a browser.

    The page is served on this computer to its own browsers only. Recordings are kept in a temporary folder until the
    command ends; nothing leaves the computer.
    """
    from reba.app.server import AppServer

    server = AppServer(port)
    echo(f"{server.address}  (Ctrl-C ends it and deletes what was dropped)")
    if browser:
        webbrowser.open_new_tab(server.address)
    server.run()
