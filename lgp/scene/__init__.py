"""Scenes: agents, tables and objects as records, their TOML files, and body measures."""
