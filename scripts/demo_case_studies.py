#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Demonstrates the case studies with security: a sealed platoon, and a strike that only the mission centre may order.

    demo_case_studies.py [FOLDER]

FOLDER contains the programs; default build/release/apps. No processes or files are left behind.
"""

import contextlib
import os
import signal
import subprocess
import sys

from demo_support import end, free_port, heading
from jadc2_fleet import PATIENCE, RIGHTS, DeferredSignals, Fleet, Trouble, clean_environment


def drive(programs):
    heading("A platoon: each vehicle has a key, states are sealed and signed (docs/platoon.md)")
    words = ["cles-platoon", "run", "--secured", "--vehicles", "3", "--hz", "50", "--brake-at", "0.5", "--slow", "22", "--slow-for", "0.5",
             "--seconds", "7"]
    print("  $ " + " ".join(words), flush=True)
    alone = {**clean_environment(), "CLES_MULTICAST": f"lo,239.255.25.37:{free_port()}"}
    with contextlib.ExitStack() as ends:
        with DeferredSignals():
            platoon = subprocess.Popen([os.path.join(programs, words[0]), *words[1:]], env=alone, text=True,
                                       stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            ends.callback(platoon.stderr.close)
            ends.callback(platoon.stdout.close)
            ends.callback(end, platoon, PATIENCE)
            ends.callback(platoon.terminate)  # it ends its vehicles
        said, errors = platoon.communicate(timeout=PATIENCE)
    if platoon.returncode != 0:
        raise Trouble(f"the platoon ended with {platoon.returncode}: {errors}")
    for line in said.splitlines():
        if line.startswith(("gap", "latency")):
            print(f"    {line}", flush=True)


def strike(programs):
    heading("Joint command: each role has its own rights, and orders to strike are signed (docs/jadc2.md)")
    with Fleet(programs, rights=RIGHTS) as command:
        striker = command.striker()
        recon = command.recon([command.satellite()])
        mission = command.mission(recon, [striker], "--duration", str(PATIENCE))
        if mission.end() not in (0, 7):  # 7: it has missed
            raise Trouble(f"no order was carried out: {mission.events}")
        for event in mission.all("bound") + mission.all("strike") + mission.all("assessed"):
            print("  mission: " + event["text"].splitlines()[0], flush=True)
        order = '{"id":"o1","lat":33.2,"lon":-106.4,"ve":0,"vn":0,"sigma":3,"sigma_v":1,"utc":0,"until":0}'
        for member in ("recon", "operator"):
            print(f"  $ cles delegate strike1:strike -d '...' --keys fleet/{member}")
            done = striker.ask(member, "delegate", "strike1:strike", "-d", order)
            print(f"    {done.stderr.strip()}", flush=True)
            if done.returncode != 5 or "denied" not in done.stderr:
                raise Trouble(f"{member} was not refused")


def main():
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    programs = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "build/release/apps")
    try:
        drive(programs)
        strike(programs)
    except (Trouble, OSError, subprocess.TimeoutExpired) as failure:
        print(f"cles: {failure}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
