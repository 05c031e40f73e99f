"""The command line: parse, call, print."""

from tissuq.cli.app import main

__all__ = ["main"]
