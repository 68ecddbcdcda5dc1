// SPDX-License-Identifier: BSL-1.0
// The updates of a noun as series of numbers, with the gaps and restarts between them.
import { markOf, SentEvent } from "./events";
import { emptyRecord, isObject, Json, listOf, numberOf, objectOf, textOf } from "./format";

export interface Mark {
    at: number; // ms
    kind: "gap" | "restart" | "lost" | "back";
    text: string;
}
export interface Track {
    points: { lat: number; lon: number }[];
}

const mostNames = 32;
const mostRows = 6000;
const mostMarks = 100;
const mostPoints = 4000; // of all tracks
const mostPublishers = 64;

/** The scalars of a value by their paths: "tyres.0.pressure". */
export function scalarsOf(value: Json, path = "", out: Map<string, Json> = new Map()): Map<string, Json> {
    if (out.size >= 256) {
        return out;
    }
    if (isObject(value)) {
        Object.keys(value).forEach((name) => scalarsOf(value[name], path === "" ? name : `${path}.${name}`, out));
    } else if (Array.isArray(value)) {
        value.slice(0, 16).forEach((each, i) => scalarsOf(each, path === "" ? String(i) : `${path}.${i}`, out));
    } else {
        out.set(path, value);
    }
    return out;
}

/** Where a value has latitude and longitude, in degrees. */
export function positionIn(value: Json, depth = 0): { lat: number; lon: number } | null {
    if (!isObject(value) || depth > 4) {
        return null;
    }
    const [lat, lon] = [value.lat ?? value.latitude, value.lon ?? value.lng ?? value.longitude];
    if (typeof lat === "number" && typeof lon === "number" && Math.abs(lat) <= 90 && Math.abs(lon) <= 180) {
        return { lat, lon };
    }
    for (const name of Object.keys(value)) {
        const found = positionIn(value[name], depth + 1);
        if (found) {
            return found;
        }
    }
    return null;
}

export class Series {
    names: string[] = []; // of all, "car1 velocity"
    rows: (number | null)[][] = []; // time in ms, and a value for each name
    marks: Mark[] = [];
    latest: Record<string, Map<string, Json>> = emptyRecord(); // by publisher; "" if there is one only
    ranges: Map<string, { least: number; most: number }> = new Map(); // by name
    tracks: Record<string, Track> = emptyRecord();
    raw = "";
    received = 0;
    published = 0; // as far as the publisher's numbers tell
    missed = 0;
    isLost = false;
    failure = "";
    private isFollowed = false; // updates have arrived since the stream began
    private epoch = "";
    private seq = 0;
    private counted: { at: number; received: number; published: number }[] = []; // over the last seconds

    constructor(private isOfAll: boolean, private spanMs = 60_000) {}

    setSpan(ms: number): void {
        this.spanMs = ms;
    }

    take(event: SentEvent, now: number): void {
        let data: Json;
        try {
            data = JSON.parse(event.data) as Json;
        } catch {
            return;
        }
        const told = objectOf(data);
        switch (event.type) {
            case "message": this.takeUpdate(event, data, now); break;
            case "gap":
                this.missed += numberOf(told.missed);
                this.mark(now, "gap", `${numberOf(told.missed)} missed${told.node === undefined ? "" : " of " + textOf(told.node)}`);
                break;
            case "restart": this.mark(now, "restart", "the publisher has restarted"); break;
            case "lost":
                this.isLost = true;
                this.mark(now, "lost", textOf(told.reason) || "the publisher is gone");
                break;
            case "rebound":
                this.isLost = false;
                this.mark(now, "back", "the publisher is back");
                break;
            case "failure":
                if (this.isOfAll && told.node !== undefined) {
                    this.mark(now, "lost", `${textOf(told.node)}: ${textOf(objectOf(told.failure).message) || "cannot be bound"}`);
                } else {
                    this.failure = textOf(told.message) || textOf(told.error);
                }
        }
    }

    /** What was published meanwhile, if anything, has not arrived. */
    interrupt(now: number, why: string): void {
        if (this.isFollowed) {
            this.isFollowed = false;
            this.mark(now, "lost", why);
        }
    }

    /** Updates a second over the last seconds: those that arrive here, and those that were published. */
    rates(now: number): { arrive: number; published: number } {
        const first = this.counted.find((each) => now - each.at < 4000);
        const seconds = first === undefined ? 0 : (now - first.at) / 1000;
        return first === undefined || seconds < 0.2 ? { arrive: 0, published: 0 }
            : { arrive: (this.received - first.received) / seconds, published: (this.published - first.published) / seconds };
    }

    private takeUpdate(event: SentEvent, data: Json, now: number): void {
        const publisher = this.isOfAll ? textOf(objectOf(data).node) : "";
        const value = this.isOfAll ? objectOf(data).update : data;
        if (value === undefined || (!(publisher in this.latest) && Object.keys(this.latest).length >= mostPublishers)) {
            return;
        }
        this.isLost = false;
        this.isFollowed = true;
        this.failure = "";
        if (now - (this.counted[this.counted.length - 1]?.at ?? -Infinity) >= 100) {
            this.counted.push({ at: now, received: this.received, published: this.published });
            this.counted.splice(0, this.counted.findIndex((each) => now - each.at < 3000));
        }
        ++this.received;
        const mark = markOf(event.id);
        if (mark) {
            this.published += mark.epoch === this.epoch && mark.seq > this.seq ? mark.seq - this.seq : 1;
            this.epoch = mark.epoch;
            this.seq = mark.seq;
        }
        this.raw = event.data;
        const scalars = scalarsOf(value);
        this.latest[publisher] = scalars;
        this.addRow(publisher, scalars, now);
        const position = positionIn(value);
        if (position) {
            const track = (this.tracks[publisher] ??= { points: [] });
            track.points.push(position);
            const most = Math.max(100, mostPoints / Object.keys(this.tracks).length);
            if (track.points.length > most) {
                track.points.splice(0, Math.ceil(track.points.length - (most * 3) / 4));
            }
        }
    }

    private addRow(publisher: string, scalars: Map<string, Json>, now: number): void {
        // More rows than the plot has points for are not kept: an update then takes the place of the one before it.
        const last = this.rows[this.rows.length - 1];
        const isSoon = last !== undefined && now - numberOf(last[0]) < this.spanMs / mostRows && !last.some((value) => Number.isNaN(value));
        const row: (number | null)[] = isSoon ? last : [now, ...this.names.map(() => null)];
        for (const [path, value] of scalars) {
            if (typeof value !== "number") {
                continue;
            }
            const name = publisher === "" ? path : `${publisher} ${path}`;
            let at = this.names.indexOf(name);
            if (at < 0 && this.names.length < mostNames) {
                at = this.names.push(name) - 1;
                this.rows.forEach((each) => each.push(null));
                if (!isSoon) {
                    row.push(null);
                }
            }
            if (at >= 0) {
                row[at + 1] = value;
                const range = this.ranges.get(name);
                this.ranges.set(name, { least: Math.min(range?.least ?? value, value), most: Math.max(range?.most ?? value, value) });
            }
        }
        if (!isSoon) {
            this.rows.push(row);
        }
        const stale = this.rows.findIndex((each) => numberOf(each[0]) >= now - this.spanMs);
        if (stale > 50 || this.rows.length > mostRows) {
            this.rows.splice(0, Math.max(stale, this.rows.length - mostRows));
        }
    }

    /** Notes what has happened, and ends the lines of the plot there. */
    private mark(now: number, kind: Mark["kind"], text: string): void {
        this.marks = [...this.marks.slice(1 - mostMarks), { at: now, kind, text }];
        if (this.rows.length > 0) {
            this.rows.push([now, ...this.names.map(() => NaN)]); // dygraphs: NaN is a gap, null a value that is not there
        }
    }
}

/** The columns that are plotted together: those of one unit, without positions, which are on the map, and times of day. */
export function plotGroups(names: string[], unitOf: (name: string) => string, isHidden: (name: string) => boolean): { unit: string; columns: number[] }[] {
    const groups: { unit: string; columns: number[] }[] = [];
    names.forEach((name, i) => {
        if (isHidden(name)) {
            return;
        }
        const unit = unitOf(name);
        const found = groups.find((each) => each.unit === unit && each.unit !== "");
        if (found) {
            found.columns.push(i);
        } else {
            groups.push({ unit, columns: [i] });
        }
    });
    return groups;
}

/** Path of a name: that of all has the publisher before it. */
export const pathIn = (name: string, isOfAll: boolean): string => (isOfAll ? name.slice(name.indexOf(" ") + 1) : name);

/** Tracks on a plane, in metres east and north of their middle, and the half of the square that shows them all. */
export function projected(tracks: Record<string, Track>): { lines: { name: string; points: [number, number][] }[]; half: number } {
    const all = Object.values(tracks).flatMap((track) => track.points);
    if (all.length === 0) {
        return { lines: [], half: 1 };
    }
    const middleOf = (values: number[]): number => (values.reduce((a, b) => Math.min(a, b)) + values.reduce((a, b) => Math.max(a, b))) / 2;
    const lat = middleOf(all.map((point) => point.lat));
    const lon = middleOf(all.map((point) => point.lon));
    const metres = 111_320; // of a degree of latitude
    const east = metres * Math.cos((lat * Math.PI) / 180);
    let half = 5;
    const lines = Object.keys(tracks).map((name) => ({
        name,
        points: tracks[name].points.map((point): [number, number] => {
            const x = (point.lon - lon) * east;
            const y = (point.lat - lat) * metres;
            half = Math.max(half, Math.abs(x), Math.abs(y));
            return [x, y];
        }),
    }));
    return { lines, half: half * 1.1 };
}

/** A round length for the scale of a map: 1, 2 or 5 times a power of ten. */
export function scaleLength(metres: number): number {
    const power = 10 ** Math.floor(Math.log10(metres));
    return metres >= 5 * power ? 5 * power : metres >= 2 * power ? 2 * power : power;
}

export const nounsIn = (reply: Json): string[] => listOf(objectOf(reply).nouns).map(textOf).filter((noun) => noun !== "");
