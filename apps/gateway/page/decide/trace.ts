// SPDX-License-Identifier: BSL-1.0
// A trace as a waterfall. The clocks of nodes are not compared: what a node has received is placed in the middle of the
// time for which its sender has waited.
import { Json, listOf, numberOf, objectOf, textOf } from "./format";

export interface Bar {
    node: string;
    label: string;
    depth: number;
    startUs: number;
    totalUs: number | null; // null: it has not ended
    queueUs: number;
    runUs: number;
    outcome: string;
    isReceived: boolean;
}

interface Span {
    node: string;
    span: string;
    parent: string;
    isReceived: boolean;
    label: string;
    startUs: number;
    totalUs: number | null;
    queueUs: number;
    runUs: number;
    outcome: string;
}

const mostSpans = 1000;
const deepest = 64;

/** \param results of PULL all:cles/trace/ID, by node */
export function spansIn(results: Json): Span[] {
    const nodes = objectOf(results);
    return Object.keys(nodes)
        .flatMap((node) =>
            listOf(objectOf(nodes[node]).spans).map((told): Span => {
                const read = objectOf(told);
                const next = textOf(read.next);
                return {
                    node, span: textOf(read.span), parent: textOf(read.parent), isReceived: read.kind === "received",
                    label: `${textOf(read.verb)} ${textOf(read.target)}:${textOf(read.task)}${next === "" ? "" : ` by ${next}`}`,
                    startUs: numberOf(read.start_us), totalUs: typeof read.total_us === "number" ? read.total_us : null,
                    queueUs: numberOf(read.queue_us), runUs: numberOf(read.run_us), outcome: textOf(read.outcome),
                };
            }),
        )
        .slice(0, mostSpans);
}

export function waterfall(spans: Span[]): Bar[] {
    const sent = spans.filter((each) => !each.isReceived);
    const received = spans.filter((each) => each.isReceived);
    const shown = new Set<Span>();
    const bars: Bar[] = [];
    const add = (span: Span, startUs: number, depth: number): void => {
        if (shown.has(span) || depth > deepest) {
            return;
        }
        shown.add(span);
        bars.push({ ...span, depth, startUs });
        const below = span.isReceived
            ? sent.filter((each) => each.parent === span.span && each.node === span.node)
            : received.filter((each) => each.parent === span.span);
        below.sort((a, b) => a.startUs - b.startUs);
        for (const each of below) {
            const waited = span.totalUs ?? each.totalUs ?? 0;
            add(each, span.isReceived ? startUs + each.startUs - span.startUs : startUs + Math.max(0, (waited - (each.totalUs ?? waited)) / 2), depth + 1);
        }
    };
    const known = new Set(spans.map((each) => each.span));
    const roots = spans.filter((each) => !known.has(each.parent));
    [...roots, ...spans].forEach((each) => add(each, each.startUs, 0));
    const first = bars.reduce((least, bar) => Math.min(least, bar.startUs), Infinity);
    return bars.map((bar) => ({ ...bar, startUs: bar.startUs - first }));
}

export const endOf = (bars: Bar[]): number => bars.reduce((most, bar) => Math.max(most, bar.startUs + (bar.totalUs ?? 0)), 1);

export const isTraceId = (text: string): boolean => /^[0-9a-f]{32}$/.test(text) && !/^0+$/.test(text);

const hex = (bytes: Uint8Array): string => [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");

/** A new trace, and how it is stated to the gateway. \param random 24 bytes */
export function newTrace(random: Uint8Array): { id: string; stated: string } {
    random[0] |= 1; // not all zero
    random[16] |= 1;
    const id = hex(random.slice(0, 16));
    return { id, stated: `00-${id}-${hex(random.slice(16, 24))}-01` };
}
