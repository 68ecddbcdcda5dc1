// SPDX-License-Identifier: BSL-1.0
// Numbers, times and sizes as people read them.

/** What nodes tell, as it was read from JSON. */
export type Json = null | boolean | number | string | Json[] | { [name: string]: Json };
export type JsonObject = { [name: string]: Json };

export const isObject = (value: unknown): value is JsonObject =>
    typeof value === "object" && value !== null && !Array.isArray(value);
/** Nodes may tell anything: these read what is of the expected type, and nothing else. */
export const objectOf = (value: unknown): JsonObject => (isObject(value) ? value : {});
export const listOf = (value: unknown): Json[] => (Array.isArray(value) ? value : []);
export const textOf = (value: unknown): string => (typeof value === "string" ? value : "");
export const numberOf = (value: unknown): number => (typeof value === "number" && Number.isFinite(value) ? value : 0);
/** Names that nodes choose may be "__proto__": objects that are indexed by them have no prototype. */
export const emptyRecord = <T>(): Record<string, T> => Object.create(null) as Record<string, T>;

const groups = (digits: string): string => digits.replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** With as many digits as are worth reading: 12 345, 12.35, 0.00123, 1.2e-7. */
export function numberText(value: number): string {
    const size = Math.abs(value);
    if (!Number.isFinite(value)) {
        return "–";
    }
    if (Number.isInteger(value) && size < 1e15) {
        return (value < 0 ? "−" : "") + groups(String(size));
    }
    if (size !== 0 && (size < 1e-3 || size >= 1e15)) {
        return value.toExponential(2).replace("-", "−");
    }
    const digits = size >= 1000 ? 1 : size >= 10 ? 2 : size >= 0.1 ? 3 : 5;
    const [whole, part] = size.toFixed(digits).split(".");
    return (value < 0 ? "−" : "") + groups(whole) + "." + part;
}

/** 512 B, 1.4 kB, 20 MB. */
export function bytesText(bytes: number): string {
    const units = ["B", "kB", "MB", "GB", "TB"];
    let size = bytes;
    let unit = 0;
    for (; size >= 1000 && unit + 1 < units.length; ++unit) {
        size /= 1000;
    }
    return `${unit > 0 && size < 10 ? size.toFixed(1) : Math.round(size)} ${units[unit]}`;
}

/** 12 µs, 8.4 ms, 3.2 s, 5 min 7 s, 3 h 12 min, 2 d 4 h. */
export function durationText(ms: number): string {
    if (ms < 1) {
        return `${Math.round(ms * 1000)} µs`;
    }
    if (ms < 1000) {
        return `${ms < 10 ? ms.toFixed(1) : Math.round(ms)} ms`;
    }
    const seconds = ms / 1000;
    if (seconds < 60) {
        return `${seconds < 10 ? seconds.toFixed(1) : Math.round(seconds)} s`;
    }
    const minutes = Math.floor(seconds / 60);
    if (minutes < 60) {
        return `${minutes} min ${Math.floor(seconds % 60)} s`;
    }
    const hours = Math.floor(minutes / 60);
    return hours < 48 ? `${hours} h ${minutes % 60} min` : `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

export const rateText = (perSecond: number): string =>
    (perSecond >= 100 ? numberText(Math.round(perSecond)) : perSecond.toFixed(perSecond < 10 ? 1 : 0)) + "/s";

/** The time of day, of this computer. */
export const clockText = (ms: number): string => new Date(ms).toTimeString().slice(0, 8);

/** Whether a number with this unit is a point in time: seconds since 1970. */
export const isInstant = (value: number, unit: string): boolean => unit === "s" && value > 1e9 && value < 1e10;

/** For an axis: without zeros at the end. */
export const tickText = (value: number): string => numberText(value).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");

export function valueText(value: Json, unit = ""): string {
    if (typeof value === "number") {
        const exact = String(value);
        return isInstant(value, unit) ? new Date(value * 1000).toISOString().replace("T", " ").slice(0, 23)
            : exact.length <= 11 && !Number.isInteger(value) ? exact.replace("-", "−") : numberText(value);
    }
    return typeof value === "string" ? value : JSON.stringify(value);
}

/** "1 node", "2 nodes". */
export const count = (n: number, what: string): string => `${numberText(n)} ${what}${n === 1 ? "" : "s"}`;
