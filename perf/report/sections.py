# SPDX-License-Identifier: BSL-1.0
"""The sections of the report, in order. Each is measured by an executable script in perf/evaluation.

A script takes [--quick] [-o FILE], and with the option --programs the folder of the programs. It reports progress on stderr, and
writes one JSON object:

    title, command, date, quick
    machine     an object with processor and cores
    figures     each with name, what (a description), value (a median), low and high (its 95 % interval), runs, unit, paper,
                target (a description), reached, and, for a ratio (the unit "times"), ran: what each side ran, in one line
    skipped     each with what and reason
    series, pictures    see series_pictures.py

With nothing to measure, it reports that and exits with 77.
"""

import os
from dataclasses import dataclass


@dataclass(frozen=True)
class Section:
    name: str  # of the script, without its suffix
    title: str
    paper: str  # what the paper reports about it; empty if nothing
    targets: tuple = ()  # of the build, as patterns; those that exist are built
    programs: str = "apps"  # the folder of the build in which its script looks for them


SECTIONS = (
    Section("bench", "Point to point against a hand-written exchange",
            "Section 4.1, Fig. 3: a PULL of the localization takes about 1.5 ms longer than the traditional packet by a "
            "minimal TCP client and server; its 132 bytes are three times as many, and fit into a frame of 1500. Parsing "
            "is constant for a request whose length is, and O(n) of the message.", ("cles_command", "cles_bench")),
    Section("latency", "Latency across links, packet size and effort",
            "Section 4 and 4.1: at most 100 ms for platooning, of which the overhead should be within a tenth; BIND and UPDATE "
            "save half of the round trip; measured on one machine and across WiFi. 30 lines of code with CLES, a tenth of "
            "what the packet with its own TCP client and server takes.", ("cles_command", "cles_bench", "cles_link_*", "*_localization")),
    Section("dsgd", "Distributed stochastic gradient descent",
            "Section 4.2, Table 2: a classifier trained by threads, and by daemons to which shards are delegated. DELEGATE on one "
            "machine takes 10 ms longer than threads alone, less than 0.5 % of the whole, and 100 ms more across the network. "
            "Plugin and manager have less than 300 lines.", ("clesd", "cles_dsgd", "cles_plugin_sgd", "cles_link_relay")),
    Section("digits_speed", "Distributed descent on handwritten digits", "", ("clesd", "cles_dsgd", "cles_plugin_digits")),
    Section("platoon", "Platooning", "Section 4.2, the first case study: each vehicle BINDs to the localization of its leader "
            "and of the one ahead.", ("cles_command", "clesd", "cles_platoon")),
    Section("platoon_cells", "Platooning: collisions at each rate with each loss, by the control law alone", "", ("cles_platoon",)),
    Section("platoon_gains", "Platooning: gains from vehicle to vehicle, by the control law alone", "", ("cles_platoon",)),
    Section("strike_latency", "Allocation of tasks: from track to strike",
            "Section 4.2, the second case study: DELEGATE of video processing to a node that offers it, tracks to all that are "
            "bound, and DELEGATE of a strike.", ("clesd", "cles_jadc2", "cles_plugin_fmv", "cles_plugin_strike")),
    Section("decision_latency", "From data to decision, and to the answer",
            "Sections 2.2 and 4.2: from the sensor to the decision, and to the strike. It reports no time.",
            ("cles_command", "clesd", "cles_jadc2", "cles_plugin_fmv", "cles_plugin_strike")),
    Section("peers", "Beside other middleware", "", ("cles_command", "clesd", "cles_peer_*"), "perf/peers"),
)


def known(folder):
    """Those of the table, then all other executable scripts in the folder."""
    names = {section.name for section in SECTIONS}
    others = sorted(entry[:-3] for entry in os.listdir(folder)
                    if entry.endswith(".py") and entry[:-3] not in names and os.access(os.path.join(folder, entry), os.X_OK))
    return [*SECTIONS, *(Section(name, name.replace("_", " ").capitalize(), "") for name in others)]
