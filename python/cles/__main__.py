# SPDX-License-Identifier: BSL-1.0
"""`python -m cles types NODE [TASK...]`: prints the types that a node tells as Python dataclasses."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from typing import Any

from .errors import Error, RefusedError
from .grammar import Malformed
from .node import Node
from .schemas import dataclasses_of


async def _ask(node: Node, name: str, tasks: list[str]) -> list[tuple[str, dict[str, Any]]]:
    if not tasks:
        described = await node.pull(f"{name}:cles")
        if "types" not in described.get("features", ()):
            raise Error("no_task", f"{name} tells no types")
        tasks = sorted({each["task"] for each in described.get("tasks") or ()})
    told = [(task, await node.pull(f"{name}:cles/types/{task}")) for task in tasks]
    return [(task, types) for task, types in told if isinstance(types, dict) and types]


async def _types(arguments: argparse.Namespace) -> str:
    async with Node(through=arguments.at, keys=arguments.keys) as node:
        return dataclasses_of(await _ask(node, arguments.node, arguments.task))


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m cles", description="What the package offers on the command line.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    types = commands.add_parser("types", help="print the types that a node tells as Python dataclasses")
    types.add_argument("node", metavar="NODE", help="the name of the node, or self")
    types.add_argument("task", metavar="TASK", nargs="*", help="only of these tasks")
    types.add_argument("--at", metavar="URL", default=os.environ.get("CLES_AT") or "tcp://127.0.0.1:25370",
                       help="the node, or one that knows it (default: $CLES_AT, otherwise %(default)s)")
    types.add_argument("--keys", metavar="DIR", default=os.environ.get("CLES_KEYS") or None,
                       help="the key of a member of a secured fleet (default: $CLES_KEYS)")
    arguments = parser.parse_args(words)
    try:
        sys.stdout.write(asyncio.run(_types(arguments)))
    except (Error, RefusedError, Malformed, OSError) as error:
        print(f"cles: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
