// SPDX-License-Identifier: BSL-1.0
// What the address of the page means. It is after '#', so that the browser keeps it to itself.

export interface Place {
    view: string; // "" is the fleet
    parts: string[];
}

export function placeOf(hash: string): Place {
    const parts = hash.replace(/^#?\/?/, "").split("/").filter((part) => part !== "");
    const decoded = parts.map((part) => {
        try {
            return decodeURIComponent(part);
        } catch {
            return part;
        }
    });
    return { view: decoded[0] ?? "", parts: decoded.slice(1) };
}

export const hashOf = (view: string, ...parts: string[]): string =>
    "#/" + [view, ...parts].filter((part) => part !== "").map(encodeURIComponent).join("/");

/** The path of a request to the gateway. A noun is a task and its parameters, as nodes write them: escaped, with '/'. */
export const requestPath = (verb: string, node: string, task: string, parameters: string[] = []): string =>
    "/" + [verb.toLowerCase(), node, task, ...parameters].map(encodeURIComponent).join("/");

/** The task and the parameters of a noun, without their escapes. */
export const nounParts = (noun: string): string[] => placeOf(noun).view === "" ? [] : [placeOf(noun).view, ...placeOf(noun).parts];
