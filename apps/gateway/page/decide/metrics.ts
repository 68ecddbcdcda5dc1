// SPDX-License-Identifier: BSL-1.0
// What nodes count: rates, and which counters tell of trouble.
import { isObject, Json, numberOf, objectOf } from "./format";

export type Flat = Map<string, number>;

const mostMembers = 1024;

/** The numbers of a reply to PULL cles/metrics, by their paths: "memory.used". */
export function flatNumbers(value: Json, path = "", out: Flat = new Map()): Flat {
    if (typeof value === "number" && out.size < mostMembers) {
        out.set(path, value);
    } else if (isObject(value)) {
        for (const name of Object.keys(value)) {
            flatNumbers(value[name], path === "" ? name : `${path}.${name}`, out);
        }
    }
    return out;
}

/** Counters that should not rise. */
export const troubles: { path: string; kind: "drop" | "refused"; text: string }[] = [
    { path: "updates_shed", kind: "drop", text: "updates dropped for slow subscribers" },
    { path: "updates_too_large", kind: "drop", text: "updates too long for a datagram" },
    { path: "updates_unsigned", kind: "drop", text: "updates dropped without the signature they need" },
    { path: "group_unsent", kind: "drop", text: "datagrams not sent: too long, or too many waited" },
    { path: "group_failed", kind: "drop", text: "datagrams that the system did not send" },
    { path: "memory.refused", kind: "drop", text: "times without memory for a peer" },
    { path: "federation.updates_dropped_to_nats", kind: "drop", text: "updates dropped on the way to NATS" },
    { path: "federation.updates_dropped_to_node", kind: "drop", text: "updates of other pools dropped" },
    { path: "gateway.updates_missed", kind: "drop", text: "updates missed by clients of the gateway" },
    { path: "pool.refused", kind: "drop", text: "jobs refused as busy" },
    { path: "links_refused", kind: "refused", text: "links refused at the limit" },
    { path: "peers_refused", kind: "refused", text: "nodes refused at the limit" },
    { path: "datagrams_unsealed", kind: "refused", text: "datagrams of strangers dropped: not sealed" },
    { path: "group_unopened", kind: "refused", text: "datagrams of strangers dropped: not of this fleet" },
    { path: "group_copied", kind: "refused", text: "copied datagrams dropped" },
    { path: "federation.messages_refused", kind: "refused", text: "messages of other pools refused" },
    { path: "gateway.denied", kind: "refused", text: "HTTP requests refused: host, origin or token" },
    { path: "gateway.connections_refused", kind: "refused", text: "HTTP connections refused at the limit" },
];

/** What is kept of each sample, for the plots of a node. */
export const plotted: { title: string; unit: string; lines: { path: string; label: string; isRate: boolean; scale?: number }[] }[] = [
    {
        title: "Requests and failures",
        unit: "per second",
        lines: [
            { path: "requests", label: "requests", isRate: true },
            { path: "errors", label: "failures", isRate: true },
            { path: "requests_sent", label: "sent", isRate: true },
        ],
    },
    {
        title: "Updates",
        unit: "per second",
        lines: [
            { path: "updates_published", label: "published", isRate: true },
            { path: "updates_delivered", label: "delivered", isRate: true },
            { path: "updates_received", label: "received", isRate: true },
            { path: "updates_shed", label: "dropped", isRate: true },
        ],
    },
    {
        title: "Jobs",
        unit: "now",
        lines: [
            { path: "pool.running", label: "running", isRate: false },
            { path: "pool.queued", label: "queued", isRate: false },
            { path: "pool.workers", label: "workers", isRate: false },
        ],
    },
    {
        title: "Jobs moved",
        unit: "per second",
        lines: [
            { path: "jobs_moved_in", label: "from others", isRate: true },
            { path: "jobs_moved_out", label: "to others", isRate: true },
        ],
    },
    {
        title: "Links",
        unit: "now",
        lines: [{ path: "links_open", label: "open", isRate: false }],
    },
    {
        title: "Handlers, p99 since the start",
        unit: "ms",
        lines: [{ path: "handler_us.p99", label: "p99", isRate: false, scale: 1e-3 }],
    },
    {
        title: "Memory for peers",
        unit: "kB",
        lines: [{ path: "memory.used", label: "used", isRate: false, scale: 1e-3 }],
    },
];
const keptPaths = plotted.flatMap((plot) => plot.lines.map((line) => line.path));

export interface Sample {
    at: number; // ms
    values: (number | undefined)[]; // of keptPaths
}

const requestsIn = (flat: Flat): number =>
    [...flat].reduce((sum, [path, value]) => (path.startsWith("requests.") ? sum + value : sum), 0);

export const sampleOf = (flat: Flat, at: number): Sample => ({
    at,
    values: keptPaths.map((path) => (path === "requests" ? requestsIn(flat) : flat.get(path))),
});

/** The rows of a plot: time, and a value for each line; null where it is not known, as after a restart. */
export function plotRows(samples: Sample[], plot: (typeof plotted)[number]): (number | null)[][] {
    const at = plot.lines.map((line) => keptPaths.indexOf(line.path));
    return samples.slice(1).map((sample, i) => {
        const before = samples[i]; // of the sample before, because of slice
        const seconds = (sample.at - before.at) / 1000;
        return [
            sample.at,
            ...plot.lines.map((line, k) => {
                const value = sample.values[at[k]];
                const last = before.values[at[k]];
                if (value === undefined || (line.isRate && (last === undefined || value < last || seconds <= 0))) {
                    return null;
                }
                return (line.isRate ? (value - numberOf(last)) / seconds : value) * (line.scale ?? 1);
            }),
        ];
    });
}

/** Whether a node tells any of it. */
export const isTold = (samples: Sample[], plot: (typeof plotted)[number]): boolean =>
    samples.length > 0 && plot.lines.some((line) => samples[samples.length - 1].values[keptPaths.indexOf(line.path)] !== undefined);

/** How much each counter of trouble has risen. Nothing after a restart, which counts anew. */
export function risenTroubles(before: Flat, after: Flat): { path: string; kind: "drop" | "refused"; text: string; by: number }[] {
    return troubles
        .map((each) => ({ ...each, by: (after.get(each.path) ?? 0) - (before.get(each.path) ?? 0) }))
        .filter((each) => each.by > 0);
}

/** The times of each task: rows of task, verb, samples, p50 and p99 in microseconds. */
export function taskTimes(metrics: Json): { task: string; verb: string; samples: number; p50: number; p99: number }[] {
    const tasks = isObject(metrics) && isObject(metrics.tasks_us) ? metrics.tasks_us : {};
    return Object.keys(tasks).flatMap((task) => {
        const verbs = tasks[task];
        return isObject(verbs)
            ? Object.keys(verbs).map((verb) => {
                  const told = objectOf(verbs[verb]);
                  return { task, verb, samples: numberOf(told.samples), p50: numberOf(told.p50), p99: numberOf(told.p99) };
              })
            : [];
    });
}
