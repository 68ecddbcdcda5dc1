// SPDX-License-Identifier: BSL-1.0
// Server-sent events, from the text of a response.

export interface SentEvent {
    type: string;
    id: string; // of the last event that had one
    data: string;
}

const longest = 4_000_000; // of a line; then the rest of the stream is not read

export class EventReader {
    retryMs = 1000;
    private rest = "";
    private type = "";
    private id = "";
    private data: string[] = [];

    take(text: string): SentEvent[] {
        const found: SentEvent[] = [];
        const lines = (this.rest + text).split("\n");
        this.rest = lines.pop() ?? "";
        if (this.rest.length > longest) {
            throw new Error("an event is too long");
        }
        for (const line of lines) {
            this.takeLine(line.endsWith("\r") ? line.slice(0, -1) : line, found);
        }
        return found;
    }

    private takeLine(line: string, found: SentEvent[]): void {
        if (line === "") {
            if (this.data.length > 0) {
                found.push({ type: this.type || "message", id: this.id, data: this.data.join("\n") });
            }
            this.type = "";
            this.data = [];
            return;
        }
        const colon = line.indexOf(":");
        const name = colon < 0 ? line : line.slice(0, colon);
        const value = colon < 0 ? "" : line.slice(colon + 1).replace(/^ /, "");
        if (name === "data") {
            this.data.push(value);
        } else if (name === "event") {
            this.type = value;
        } else if (name === "id") {
            this.id = value;
        } else if (name === "retry" && /^\d{1,6}$/.test(value)) {
            this.retryMs = Number(value);
        }
    }
}

/** Which update it is: "5f3a09c1.17". */
export function markOf(id: string): { epoch: string; seq: number } | null {
    const found = /^([0-9a-f]+)\.(\d+)$/.exec(id);
    return found ? { epoch: found[1], seq: Number(found[2]) } : null;
}

/** The least time between two updates: that of one node, or of each of many, so that the page has at most some 60 a second. */
export function thinned(every: number, nodes: number): number {
    const perSecond = 60;
    const least = Math.ceil((1000 * Math.max(nodes, 1)) / perSecond);
    return every === 0 && nodes <= 1 ? 0 : Math.min(Math.max(every, least), 10_000);
}
