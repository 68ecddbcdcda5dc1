// SPDX-License-Identifier: BSL-1.0
// Requests to the gateway that serves this page, and to nothing else.
import { EventReader, SentEvent } from "./decide/events";
import { Json, objectOf, textOf } from "./decide/format";

export interface Reply {
    status: number; // 0: the gateway does not answer
    value: Json;
    ms: number;
}
export interface Asked {
    body?: string;
    deadlineMs?: number;
    trace?: string;
    signal?: AbortSignal;
    headers?: Record<string, string>;
}

let whenEnded: () => void = () => undefined;
/** \param call called when the gateway wants a token */
export function onSessionEnd(call: () => void): void {
    whenEnded = call;
}

function headersOf(asked: Asked): Record<string, string> {
    const headers: Record<string, string> = { ...asked.headers };
    if (asked.body !== undefined) {
        headers["Content-Type"] = "application/json";
    }
    if (asked.deadlineMs) {
        headers["Cles-Deadline"] = String(asked.deadlineMs);
    }
    if (asked.trace) {
        headers.traceparent = asked.trace;
    }
    return headers;
}

export const failureText = (reply: Reply): string => {
    const told = objectOf(reply.value);
    return textOf(told.message) || textOf(told.error) || `status ${reply.status}`;
};
const unreachable = (ms: number, text = "the gateway does not answer"): Reply => ({ status: 0, value: { error: "unavailable", message: text }, ms });

function valueOf(text: string): Json {
    try {
        return text === "" ? {} : (JSON.parse(text) as Json);
    } catch {
        return text;
    }
}

export async function ask(method: string, path: string, asked: Asked = {}): Promise<Reply> {
    const begun = performance.now();
    try {
        const response = await fetch(path, { method, body: asked.body, headers: headersOf(asked), signal: asked.signal });
        const text = await response.text();
        if (response.status === 401) {
            whenEnded();
        }
        return { status: response.status, value: valueOf(text), ms: performance.now() - begun };
    } catch {
        return unreachable(performance.now() - begun, asked.signal?.aborted ? "cancelled" : undefined);
    }
}

async function readEvents(response: Response, reader: EventReader, take: (events: SentEvent[]) => void): Promise<void> {
    const body = response.body?.getReader();
    const decoder = new TextDecoder();
    for (let part = await body?.read(); body && part && !part.done; part = await body.read()) {
        const events = reader.take(decoder.decode(part.value, { stream: true }));
        if (events.length > 0) {
            take(events);
        }
    }
}

/** A DELEGATE that tells its progress: a number from 0 to 1, and details. */
export async function delegate(path: string, asked: Asked, progress: (fraction: number, details: Json) => void): Promise<Reply> {
    const begun = performance.now();
    const headers = { ...headersOf(asked), Accept: "text/event-stream" };
    let last: Reply | null = null;
    try {
        const response = await fetch(path, { method: "POST", body: asked.body, headers, signal: asked.signal });
        if (!(response.headers.get("Content-Type") ?? "").startsWith("text/event-stream")) {
            const text = await response.text();
            if (response.status === 401) {
                whenEnded();
            }
            return { status: response.status, value: valueOf(text), ms: performance.now() - begun };
        }
        await readEvents(response, new EventReader(), (events) => {
            for (const event of events) {
                const value = valueOf(event.data);
                if (event.type === "progress") {
                    progress(Number(objectOf(value).fraction) || 0, objectOf(value).details ?? {});
                } else {
                    last = { status: event.type === "result" ? 200 : 500, value, ms: performance.now() - begun };
                }
            }
        });
    } catch {
        return unreachable(performance.now() - begun, asked.signal?.aborted ? "cancelled" : undefined);
    }
    return last ?? unreachable(performance.now() - begun, "the stream ended without a result");
}

const pause = (ms: number): Promise<void> => new Promise((then) => setTimeout(then, ms));

/** Follows a stream of events, and comes back when it ends. \param tell what is wrong; empty: nothing. \return ends it */
export function follow(path: string, take: (events: SentEvent[]) => void, tell: (wrong: string) => void): () => void {
    const stop = new AbortController();
    let last = "";
    const run = async (): Promise<void> => {
        while (!stop.signal.aborted) {
            const reader = new EventReader();
            try {
                const headers: Record<string, string> = last === "" ? {} : { "Last-Event-ID": last };
                const response = await fetch(path, { headers, signal: stop.signal });
                if (response.status === 200) {
                    tell("");
                    await readEvents(response, reader, (events) => {
                        last = events[events.length - 1].id || last;
                        take(events);
                    });
                    tell("the stream has ended; trying again");
                } else {
                    const reply = { status: response.status, value: valueOf(await response.text()), ms: 0 };
                    if (reply.status === 401) {
                        whenEnded();
                    }
                    tell(failureText(reply));
                    if (reply.status < 500) {
                        return;
                    }
                }
            } catch {
                if (!stop.signal.aborted) {
                    tell("the gateway does not answer; trying again");
                }
            }
            await pause(reader.retryMs);
        }
    };
    void run();
    return () => stop.abort();
}

/**
 * Calls again and again while the page is seen, with a pause in between.
 * \param next does one round, and returns the pause in ms \param tell why a round has failed; the next one follows
 */
export function poll(next: () => Promise<number>, tell: (wrong: string) => void): () => void {
    let ended = false;
    const run = async (): Promise<void> => {
        while (!ended) {
            let ms = 1000;
            try {
                ms = document.hidden ? ms : await next();
            } catch (error) { // any node may tell anything
                tell(`what was told cannot be read: ${String(error)}`);
            }
            await pause(ms);
        }
    };
    void run();
    return () => {
        ended = true;
    };
}
