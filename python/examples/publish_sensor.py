#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Publishes what a sensor measures, ten times a second, and answers requests for it.

    publish_sensor.py [URL]
    cles bind thermo:temperature --at tcp://127.0.0.1:25373
"""

import asyncio
import math
import sys
import time
from dataclasses import dataclass
from typing import Annotated

import cles


@dataclass
class Temperature:
    time: Annotated[float, cles.Field(unit="s", description="since the program began")]
    celsius: Annotated[float, cles.Field(unit="°C", minimum=-40, maximum=125)]


began = time.monotonic()


def measure() -> Temperature:
    """What the sensor says now."""
    now = time.monotonic() - began  # put the reading of your sensor here
    return Temperature(round(now, 3), round(21 + 3 * math.sin(now), 2))


async def main(url: str) -> None:
    async with cles.Node("thermo", listen=[url]) as node:
        node.on_pull("temperature", description="The temperature now")(measure)
        node.offer("temperature", Temperature, description="The temperature, ten times a second")
        print(f"thermo listens on {node.endpoints[0]}", flush=True)
        while True:
            node.publish("temperature", measure())
            await asyncio.sleep(0.1)


if __name__ == "__main__":
    try:
        asyncio.run(main(*(sys.argv[1:] or ["tcp://127.0.0.1:25373"])))
    except KeyboardInterrupt:
        pass
