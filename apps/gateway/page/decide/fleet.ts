// SPDX-License-Identifier: BSL-1.0
// The fleet as the page knows it: what nodes have answered, who is lost, and what has gone wrong.
import { emptyRecord, isObject, Json, JsonObject, listOf, numberOf, objectOf, textOf } from "./format";
import { Flat, flatNumbers, risenTroubles, Sample, sampleOf } from "./metrics";

export interface Task {
    verb: string;
    task: string;
    description: string;
    parameters: string[];
    isSigned: boolean;
    isLocal: boolean;
}
export type NodeState = "live" | "suspect" | "lost" | "left";

export interface FleetNode {
    name: string; // as requests name it: with its pool, if that is another one
    pool: string;
    version: string;
    epoch: string;
    uptimeMs: number;
    endpoints: string[];
    tasks: Task[];
    types: string; // the digest
    load: { queued: number; running: number; workers: number };
    roster: number;
    state: NodeState;
    isClash: boolean;
    why: string; // it does not answer
    seenAt: number; // it has answered last
    metrics: JsonObject;
    flat: Flat | null;
    samples: Sample[];
}
export interface Edge {
    from: string;
    to: string;
    state: string;
    ageMs: number;
    via: string; // empty: by a link, or not known
}
export interface Note {
    at: number;
    kind: "lost" | "left" | "back" | "new" | "restart" | "clash" | "refused" | "drop";
    node: string;
    text: string;
    by: number; // how often, of refused and drop
}
export interface Fleet {
    nodes: Record<string, FleetNode>;
    edges: Edge[];
    pools: { bridge: string; pool: string; state: string; nodes: number }[]; // that bridges reach
    notes: Note[]; // the newest last
    failure: string; // of the last question; empty if there was none
    startedAt: number;
}

export const emptyFleet = (now: number): Fleet => ({
    nodes: emptyRecord(), edges: [], pools: [], notes: [], failure: "", startedAt: now,
});

const mostNotes = 100; // and as many again that count something
const mostSamples = 600;
const mostNodes = 2000;

/** The replies of one round; null if one has failed. */
export interface Answers {
    identities: Json;
    peers: Json;
    metrics: Json;
    failure: string;
}

/** The reply of all nodes, with that of one which is asked by itself. */
export function withResult(all: Json, name: string, own: Json): Json {
    const results = Object.assign(emptyRecord<Json>(), objectOf(objectOf(all).results));
    const errors = Object.assign(emptyRecord<Json>(), objectOf(objectOf(all).errors));
    delete errors[name];
    if (own !== null) {
        results[name] = own;
    }
    return { results, errors };
}

function taskOf(told: Json): Task {
    const read = objectOf(told);
    return {
        verb: textOf(read.verb), task: textOf(read.task), description: textOf(read.description),
        parameters: listOf(read.parameters).map(textOf), isSigned: read.signed === true, isLocal: read.local === true,
    };
}

function poolOf(name: string, told: JsonObject): string {
    const pool = textOf(told.pool);
    const node = textOf(told.node);
    return name.endsWith(`.${node}`) && name.length > node.length ? name.slice(0, -node.length - 1) : pool;
}

function nodeOf(name: string, told: JsonObject, before: FleetNode | undefined, now: number): FleetNode {
    const load = objectOf(told.load);
    return {
        name, pool: poolOf(name, told), version: textOf(told.version), epoch: textOf(told.epoch),
        uptimeMs: numberOf(told.uptime_ms), endpoints: listOf(told.endpoints).map(textOf),
        tasks: listOf(told.tasks).map(taskOf).filter((task) => task.task !== ""), types: textOf(told.types),
        load: { queued: numberOf(load.queued), running: numberOf(load.running), workers: numberOf(load.workers) },
        roster: numberOf(told.roster), state: "live", isClash: false, why: "", seenAt: now,
        metrics: before?.metrics ?? {}, flat: before?.flat ?? null, samples: before?.samples ?? [],
    };
}

/** Who has told what of whom. The gateway is asked by its own name. */
function edgesIn(peers: Json): { edges: Edge[]; clashes: Set<string>; suspects: Set<string> } {
    const edges: Edge[] = [];
    const clashes = new Set<string>();
    const suspects = new Set<string>();
    const results = objectOf(objectOf(peers).results);
    for (const from of Object.keys(results)) {
        for (const told of listOf(objectOf(results[from]).peers)) {
            const entry = objectOf(told);
            const to = textOf(entry.node);
            const state = textOf(entry.state);
            if (state === "clash") {
                clashes.add(to);
            } else if (state === "suspect") {
                suspects.add(to);
            }
            edges.push({ from, to, state, ageMs: numberOf(entry.age_ms), via: textOf(entry.via) });
        }
    }
    return { edges, clashes, suspects };
}

function noteChanges(before: FleetNode | undefined, after: FleetNode, isFirst: boolean, add: (kind: Note["kind"], text: string) => void): void {
    if (before === undefined) {
        if (!isFirst) {
            add("new", "has joined");
        }
        return;
    }
    if (before.state === "lost" || before.state === "left") {
        add("back", "is back");
    }
    if (before.epoch !== after.epoch && before.epoch !== "" && after.epoch !== "") {
        add("restart", "has restarted");
    }
}

/** A node that has not answered: lost, if others miss it too or its link is gone, and suspect before that. */
function silent(node: FleetNode, failure: JsonObject | null, isMissed: boolean, now: number): FleetNode {
    const patience = 6000;
    const isDue = now - node.seenAt > patience;
    const why = failure ? textOf(failure.message) || textOf(failure.error) : isMissed ? "other nodes do not hear it" : "";
    if (node.state === "lost" || node.state === "left") {
        return node;
    }
    if (why === "" && node.state === "live") {
        return { ...node, state: "left", why: "it is not in the network any more" };
    }
    return { ...node, state: isDue || why === "" ? "lost" : "suspect", why: why || node.why };
}

/** The fleet after a round of questions. */
export function fleetAfter(fleet: Fleet, answers: Answers, now: number): Fleet {
    if (answers.failure !== "") {
        return { ...fleet, failure: answers.failure };
    }
    const results = objectOf(objectOf(answers.identities).results);
    const errors = objectOf(objectOf(answers.identities).errors);
    const { edges, clashes, suspects } = edgesIn(answers.peers);
    const metrics = objectOf(objectOf(answers.metrics).results);
    const nodes = emptyRecord<FleetNode>();
    const notes = [...fleet.notes];
    const isFirst = Object.keys(fleet.nodes).length === 0;
    const names = new Set([...Object.keys(fleet.nodes), ...Object.keys(results), ...Object.keys(errors)]);
    for (const name of [...names].slice(0, mostNodes)) {
        const before = fleet.nodes[name];
        const add = (kind: Note["kind"], text: string, by = 0): void => addNote(notes, { at: now, kind, node: name, text, by });
        const told = results[name];
        let after: FleetNode;
        if (isObject(told)) {
            after = nodeOf(name, told, before, now);
            noteChanges(before, after, isFirst, add);
            takeMetrics(after, before, metrics[name], now, add);
        } else if (isObject(errors[name]) && textOf(objectOf(errors[name]).error) === "denied") { // it is there
            after = { ...(before ?? nodeOf(name, {}, undefined, now)), state: "live", seenAt: now, why: textOf(objectOf(errors[name]).message) };
        } else {
            const known = before ?? nodeOf(name, {}, undefined, now);
            after = silent(known, isObject(errors[name]) ? objectOf(errors[name]) : null, suspects.has(name), now);
            if (after.state !== known.state && (after.state === "lost" || after.state === "left")) {
                add(after.state, after.state === "lost" ? `is lost: ${after.why}` : "has left");
            }
        }
        after.isClash = clashes.has(name);
        if (after.isClash && !(before?.isClash ?? false)) {
            add("clash", "two nodes have this name");
        }
        nodes[name] = after;
    }
    return { nodes, edges, pools: poolsIn(metrics), notes: withoutOld(notes), failure: "", startedAt: fleet.startedAt };
}

function takeMetrics(node: FleetNode, before: FleetNode | undefined, told: Json | undefined, now: number,
    add: (kind: Note["kind"], text: string, by: number) => void): void {
    if (!isObject(told)) {
        return;
    }
    const flat = flatNumbers(told);
    if (before?.flat && before.epoch === node.epoch) {
        for (const risen of risenTroubles(before.flat, flat)) {
            add(risen.kind, risen.text, risen.by);
        }
    }
    node.metrics = told;
    node.flat = flat;
    node.samples = [...node.samples.slice(1 - mostSamples), sampleOf(flat, now)];
}

/** What is counted again within half a minute is added to its note. */
function addNote(notes: Note[], note: Note): void {
    const at = note.by === 0 ? -1 : notes.findIndex((each) => each.node === note.node && each.text === note.text && note.at - each.at < 30_000);
    if (at >= 0) {
        notes[at] = { ...notes[at], by: notes[at].by + note.by };
    } else {
        notes.push(note);
    }
}

/** Counters that rise all the time leave the rest. */
function withoutOld(notes: Note[]): Note[] {
    const [counted, others] = [notes.filter((note) => note.by > 0), notes.filter((note) => note.by === 0)];
    return [...counted.slice(-mostNotes), ...others.slice(-mostNotes)].sort((a, b) => a.at - b.at);
}

function poolsIn(metrics: JsonObject): Fleet["pools"] {
    return Object.keys(metrics).flatMap((bridge) =>
        listOf(objectOf(objectOf(metrics[bridge]).federation).pools).map((told) => {
            const each = objectOf(told);
            return { bridge, pool: textOf(each.pool), state: textOf(each.state), nodes: numberOf(each.nodes) };
        }),
    );
}

/** Without a node that is gone, which nobody has to see any longer. */
export function forgotten(fleet: Fleet, name: string): Fleet {
    const nodes = Object.assign(emptyRecord<FleetNode>(), fleet.nodes);
    delete nodes[name];
    return { ...fleet, nodes };
}

/** What is wrong now, the worst first: shown on every view. */
export function problems(fleet: Fleet, now: number): { kind: Note["kind"]; text: string; node: string }[] {
    const recent = 60_000;
    const found: { kind: Note["kind"]; text: string; node: string }[] = [];
    for (const node of Object.values(fleet.nodes)) {
        if (node.state === "lost" || node.state === "suspect") {
            found.push({ kind: "lost", node: node.name, text: node.state === "lost" ? "is lost" : "does not answer" });
        }
        if (node.isClash) {
            found.push({ kind: "clash", node: node.name, text: "two nodes have this name" });
        }
    }
    const sums = new Map<string, { kind: Note["kind"]; node: string; text: string; by: number }>();
    for (const note of fleet.notes) {
        if (note.by > 0 && now - note.at < recent) {
            const key = `${note.node} ${note.text}`;
            const sum = sums.get(key) ?? { kind: note.kind, node: note.node, text: note.text, by: 0 };
            sum.by += note.by;
            sums.set(key, sum);
        }
    }
    const counted = [...sums.values()].sort((a, b) => b.kind.localeCompare(a.kind) || b.by - a.by);
    return [...found, ...counted.map((each) => ({ kind: each.kind, node: each.node, text: `${each.text}: ${each.by}` }))];
}

export const sortedNodes = (fleet: Fleet): FleetNode[] =>
    Object.values(fleet.nodes).sort((a, b) => a.pool.localeCompare(b.pool) || a.name.localeCompare(b.name, undefined, { numeric: true }));

/** How long to wait until the next round: many nodes are asked less often. */
export const roundMs = (nodes: number): number => (nodes <= 32 ? 1000 : nodes <= 128 ? 3000 : 10_000);
