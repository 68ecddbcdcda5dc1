#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Stands in for a robot that is not there, so that other programs can be tried: it answers, takes its time, and fails now and
then.

    mock_service.py [URL]
    cles delegate arm1:move -d '{"x":0.3,"y":0.1,"z":0.2}' --progress --at tcp://127.0.0.1:25374
"""

import asyncio
import random
import sys
from dataclasses import dataclass

import cles


@dataclass
class Point:
    x: float
    y: float
    z: float


async def main(url: str) -> None:
    async with cles.Node("arm1", listen=[url]) as node:
        at = Point(0.0, 0.0, 0.0)

        @node.on_pull("position")
        def position() -> Point:
            """Where the arm is"""
            return at

        @node.on_delegate("move")
        async def move(request: cles.Request, to: Point) -> Point:
            """Moves the arm, in half a second"""
            nonlocal at
            if to.z < 0:
                raise cles.Error("bad_request", "z: below the table")
            start, steps = at, 10
            for step in range(1, steps + 1):
                await asyncio.sleep(0.05)
                part = step / steps
                at = Point(*(a + (b - a) * part for a, b in ((start.x, to.x), (start.y, to.y), (start.z, to.z))))
                node.publish("position", at)
                request.progress(part, at)
            if random.random() < 0.05:
                raise cles.Error("failed", "the gripper is stuck")
            return at

        print(f"arm1 listens on {node.endpoints[0]}", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    try:
        asyncio.run(main(*(sys.argv[1:] or ["tcp://127.0.0.1:25374"])))
    except KeyboardInterrupt:
        pass
