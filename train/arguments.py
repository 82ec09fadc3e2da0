"""Command line pieces that the scripts share."""

from __future__ import annotations

import argparse
import ast
from typing import Any


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Keeps the examples' line breaks and leaves room for long option names."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=34)


def sparse_parser(description: str | None, examples: str) -> argparse.ArgumentParser:
    """Begin a parser; an option that is not given is absent from what it parses."""
    return argparse.ArgumentParser(
        description=description,
        epilog=examples,
        formatter_class=HelpFormatter,
        argument_default=argparse.SUPPRESS,
    )


class StoreKeyValues(argparse.Action):
    """Collects `key:value ...`; values are Python literals, or else text."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Add the pairs to what earlier uses of the option have given."""
        stored = getattr(namespace, self.dest, None) or {}
        for pair in values:
            key, colon, text = pair.partition(":")
            if not (key.isidentifier() and colon and text):
                parser.error(f"{option_string} takes key:value, got {pair!r}")
            stored[key] = _literal(text)
        setattr(namespace, self.dest, stored)


def _literal(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text
