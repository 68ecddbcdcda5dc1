// SPDX-License-Identifier: BSL-1.0
// Who may do what, from the fleet's roster (docs/security.md, "Rights").
import { isObject, Json, listOf, objectOf, textOf } from "./format";

export interface Member {
    number: number;
    name: string;
    may: string[] | null; // null: everything
    offers: string[] | null;
    forwards: string[];
}
export interface Roster {
    version: number;
    members: Member[];
}

const rightsIn = (told: Json | undefined): string[] | null => (told === undefined ? null : listOf(told).map(textOf));

/** \param reply that of PULL cles/roster; null if it is none */
export function rosterIn(reply: Json): Roster | null {
    const told = objectOf(reply).roster;
    if (!isObject(told)) {
        return null;
    }
    const members = listOf(told.members).map(objectOf).map((each) => ({
        number: Number(each.number), name: textOf(each.name), may: rightsIn(each.may), offers: rightsIn(each.offers),
        forwards: listOf(each.forwards).map(textOf),
    }));
    return { version: Number(told.version), members };
}

const escaped = (text: string): string => text.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&");

function decoded(text: string): string {
    try {
        return decodeURIComponent(text);
    } catch {
        return text;
    }
}

/** Whether "pull,bind *:localization" permits a verb, in small letters, of a noun: its node, task and parameters. */
export function permits(right: string, verb: string, node: string, path: string[]): boolean {
    const found = /^(\*|[a-z]+(?:,[a-z]+)*) ([^ :]+):([^ ]+)$/.exec(right);
    if (!found || ["self", "any", "all"].includes(found[2]) || !(found[1] === "*" || found[1].split(",").includes(verb))) {
        return false;
    }
    const isOpen = found[3].endsWith("/**");
    const parts = (isOpen ? found[3].slice(0, -3) : found[3]).split("/");
    if ([found[2], ...parts].some((part) => part.includes("**")) || (isOpen ? path.length < parts.length : path.length !== parts.length)) {
        return false;
    }
    const matches = (pattern: string, text: string): boolean => // an escaped '*' is the character
        new RegExp(`^${pattern.split("*").map((part) => escaped(decoded(part))).join(".*")}$`, "su").test(text);
    return matches(found[2], node) && parts.every((part, i) => matches(part, path[i]));
}

/** Why a member may do it, or may not; the local rules of nodes can only narrow this. */
export function verdict(roster: Roster, member: Member, verb: string, node: string, path: string[]): { may: boolean; why: string } {
    const small = verb.toLowerCase();
    const right = member.may?.find((each) => permits(each, small, node, path));
    if (member.may !== null && right === undefined) {
        return { may: false, why: "no right of the member permits it" };
    }
    const target = roster.members.find((each) => each.name === node);
    if (!target) {
        return { may: false, why: `${node} is no member` };
    }
    const offer = target.offers?.find((each) => permits(each, small === "update" ? "bind" : small, node, path));
    if (target.offers !== null && offer === undefined) {
        return { may: false, why: `${node} does not offer it` };
    }
    return { may: true, why: right ?? "everything" };
}
