"""`reba app`: scoring by drag and drop in a browser, served on this machine only.

    browser -> loopback server (`server`) -> recordings in a temporary folder (`recordings`) -> reba -> report, workbook

Nothing leaves the machine, and nothing is kept: the folder is removed when the server ends.
"""
