"""Errors that the command line explains. No imports: a command that only looks for a stack starts without pydantic."""

from __future__ import annotations


class ConfigError(Exception):
    """The configuration of a machine, or a file of it, is missing, malformed or out of range.

    The message is one line that names the file or folder, and the field.
    """
