// SPDX-License-Identifier: BSL-1.0
// Forms, units and bodies from the types that a node tells (docs/protocol.md, "Types").
import { isObject, Json, JsonObject, listOf, objectOf, textOf } from "./format";

export interface Field {
    path: string; // "tyre.front"; empty: the whole
    label: string;
    kind: "object" | "number" | "integer" | "boolean" | "text" | "time" | "choice" | "json";
    unit: string;
    description: string;
    minimum?: number;
    maximum?: number;
    choices: string[]; // as JSON
    isRequired: boolean;
    isNullable: boolean;
    initial: string; // what is in the form first
    fields: Field[];
}
export interface Meaning {
    unit: string;
    description: string;
}

const deepest = 6;
const mostFields = 200;

/** Follows references within the schema. What a node tells may lead in a circle. */
function resolved(schema: Json, root: JsonObject): JsonObject {
    let at = objectOf(schema);
    for (let steps = 0; typeof at.$ref === "string" && steps < 16; ++steps) {
        const { $ref, ...rest } = at;
        const name = /^#\/\$defs\/(.+)$/.exec($ref as string)?.[1];
        const found = $ref === "#" ? root : name !== undefined ? objectOf(objectOf(root.$defs)[name]) : {};
        at = at === root || $ref !== "#" ? { ...found, ...rest } : found;
    }
    return at;
}

/** Of alternatives, the only one beside null. */
function withoutNull(schema: JsonObject, root: JsonObject): { schema: JsonObject; isNullable: boolean } {
    const some = listOf(schema.anyOf);
    const others = some.filter((each) => resolved(each, root).type !== "null");
    if (some.length > 0 && others.length === 1) {
        const { anyOf: _, ...rest } = schema;
        return { schema: { ...resolved(others[0], root), ...rest }, isNullable: others.length < some.length };
    }
    return { schema, isNullable: typesOf(schema).includes("null") };
}

const typesOf = (schema: JsonObject): string[] => (typeof schema.type === "string" ? [schema.type] : listOf(schema.type).map(textOf));

function kindOf(schema: JsonObject): Field["kind"] {
    const types = typesOf(schema).filter((type) => type !== "null");
    if (listOf(schema.enum).length > 0) {
        return "choice";
    }
    if (schema.anyOf || schema.allOf || schema.const !== undefined) {
        return "json";
    }
    if (types.length === 1) {
        const plain: Record<string, Field["kind"]> = { number: "number", integer: "integer", boolean: "boolean", string: "text" };
        if (types[0] === "object") {
            return isObject(schema.properties) ? "object" : "json";
        }
        return schema.format === "date-time" || schema.format === "duration" ? "time" : plain[types[0]] ?? "json";
    }
    const isTime = types.every((type) => type === "string" || type === "number" || type === "integer");
    return types.length > 0 && isTime ? "time" : "json";
}

/** Limits of a type that hold all its values are not worth telling. */
const limit = (value: Json | undefined): number | undefined =>
    typeof value === "number" && Math.abs(value) < 4e18 ? value : undefined;

/** The form of a schema; of one that is not known, a field for any JSON. */
export function fieldOf(schema: Json, root: JsonObject = objectOf(schema), path = "", label = "", isRequired = true, budget = { left: mostFields }): Field {
    const { schema: told, isNullable } = withoutNull(resolved(schema, root), root);
    const depth = path === "" ? 0 : path.split(".").length;
    const kind = depth >= deepest || --budget.left <= 0 ? "json" : kindOf(told);
    const required = listOf(told.required);
    const properties = objectOf(told.properties);
    const field: Field = {
        path, label, kind, isRequired, isNullable,
        unit: textOf(told.unit), description: textOf(told.description) || textOf(told.title),
        minimum: limit(told.minimum), maximum: limit(told.maximum),
        choices: listOf(told.enum).map((each) => JSON.stringify(each)), initial: "",
        fields: kind === "object"
            ? Object.keys(properties).map((name) =>
                  fieldOf(properties[name], root, path === "" ? name : `${path}.${name}`, name, required.includes(name), budget))
            : [],
    };
    field.initial = initialOf(field, told, root);
    return field;
}

function initialOf(field: Field, told: JsonObject, root: JsonObject): string {
    const stated = told.default ?? listOf(told.examples)[0];
    if (field.kind === "object") {
        return "";
    }
    if (stated !== undefined) {
        return (field.kind === "text" || field.kind === "time") && typeof stated === "string" ? stated : JSON.stringify(stated);
    }
    if (!field.isRequired) {
        return "";
    }
    switch (field.kind) {
        case "choice": return field.choices[0];
        case "boolean": return "false";
        case "number":
        case "integer": return String(Math.min(Math.max(0, field.minimum ?? 0), field.maximum ?? Infinity));
        case "json": return JSON.stringify(exampleOf(told, root));
        default: return "";
    }
}

/** A value of the schema, to begin with. */
export function exampleOf(schema: Json, root: JsonObject = objectOf(schema), depth = 0): Json {
    const { schema: told, isNullable } = withoutNull(resolved(schema, root), root);
    const stated = told.default ?? told.const ?? listOf(told.examples)[0] ?? listOf(told.enum)[0];
    if (stated !== undefined || depth > deepest) {
        return stated ?? null;
    }
    const some = listOf(told.anyOf);
    if (some.length > 0) {
        return exampleOf(some[0], root, depth + 1);
    }
    const type = typesOf(told).find((each) => each !== "null");
    const required = listOf(told.required).map(textOf);
    const properties = objectOf(told.properties);
    switch (type) {
        case "object": return Object.fromEntries(required.map((name) => [name, exampleOf(properties[name] ?? {}, root, depth + 1)]));
        case "array": {
            const first = listOf(told.prefixItems).map((each) => exampleOf(each, root, depth + 1));
            const least = typeof told.minItems === "number" ? Math.min(told.minItems, 16) : 0;
            while (first.length < least) {
                first.push(exampleOf(told.items ?? {}, root, depth + 1));
            }
            return first;
        }
        case "string": return "";
        case "boolean": return false;
        case "number":
        case "integer": return Math.min(Math.max(0, limit(told.minimum) ?? 0), limit(told.maximum) ?? Infinity);
        default: return isNullable || type === "null" ? null : {};
    }
}

export interface Problem {
    path: string;
    text: string;
}
/** What is in the form, by path; what is missing is as it was first. */
export type Inputs = Record<string, string>;

export const inputOf = (field: Field, inputs: Inputs): string => inputs[field.path] ?? field.initial;

/** The body as JSON text, in which integers of 64 bits are as they were written; undefined if it is left out. */
export function bodyOf(field: Field, inputs: Inputs, problems: Problem[]): string | undefined {
    const wrong = (text: string): undefined => {
        problems.push({ path: field.path, text });
        return undefined;
    };
    if (field.kind === "object") {
        const members = field.fields
            .map((each) => [each.label, bodyOf(each, inputs, problems)])
            .filter(([, text]) => text !== undefined);
        const isLeftOut = members.length === 0 && !field.isRequired;
        return isLeftOut ? undefined : `{${members.map(([name, text]) => `${JSON.stringify(name)}:${text}`).join(",")}}`;
    }
    const text = inputOf(field, inputs);
    const trimmed = text.trim();
    if (trimmed === "" && (field.kind !== "text" || !field.isRequired)) {
        return !field.isRequired || field.path === "" ? undefined : field.isNullable ? "null" : wrong("is missing");
    }
    switch (field.kind) {
        case "text": return JSON.stringify(text);
        case "time": return isNumber(trimmed) ? trimmed : JSON.stringify(trimmed);
        case "integer": return /^-?(0|[1-9]\d*)$/.test(trimmed) ? inRange(field, trimmed, wrong) : wrong("is a whole number");
        case "number": return isNumber(trimmed) ? inRange(field, trimmed, wrong) : wrong("is a number");
        default: return isJson(trimmed) ? trimmed : wrong("is not valid JSON");
    }
}

const isNumber = (text: string): boolean => /^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$/.test(text);

function isJson(text: string): boolean {
    try {
        JSON.parse(text);
        return true;
    } catch {
        return false;
    }
}

function inRange(field: Field, text: string, wrong: (text: string) => undefined): string | undefined {
    const value = Number(text);
    if (field.minimum !== undefined && value < field.minimum) {
        return wrong(`is at least ${field.minimum}`);
    }
    return field.maximum !== undefined && value > field.maximum ? wrong(`is at most ${field.maximum}`) : text;
}

/** Units and meanings of the numbers of a value. '*' stands for any index, or any name of a map. */
export function meaningsOf(schema: Json, root: JsonObject = objectOf(schema), path = "", out: Map<string, Meaning> = new Map()): Map<string, Meaning> {
    const { schema: told } = withoutNull(resolved(schema, root), root);
    if (path.split(".").length > deepest || out.size > mostFields) {
        return out;
    }
    if (told.unit !== undefined || told.description !== undefined) {
        out.set(path, { unit: textOf(told.unit), description: textOf(told.description) });
    }
    const below = (name: string): string => (path === "" ? name : `${path}.${name}`);
    const properties = objectOf(told.properties);
    for (const name of Object.keys(properties)) {
        meaningsOf(properties[name], root, below(name), out);
    }
    for (const each of [told.items, told.additionalProperties]) {
        if (isObject(each)) {
            meaningsOf(each, root, below("*"), out);
        }
    }
    listOf(told.prefixItems).forEach((each, i) => meaningsOf(each, root, below(String(i)), out));
    return out;
}

export function meaningAt(meanings: Map<string, Meaning>, path: string): Meaning {
    const found = meanings.get(path) ?? meanings.get(path.replace(/(^|\.)\d+(?=\.|$)/g, "$1*"));
    return found ?? meanings.get(path.replace(/[^.]+$/, "*")) ?? { unit: "", description: "" };
}

/** What parameters are called: as the types say, or as the task does. */
export function parameterNames(schema: Json | undefined, told: string[]): { name: string; description: string }[] {
    const typed = listOf(objectOf(schema).prefixItems).map(objectOf);
    return Array.from({ length: Math.max(typed.length, told.length) }, (_, i) => ({
        name: told[i] || textOf(typed[i]?.title) || `parameter ${i + 1}`,
        description: [textOf(typed[i]?.description), textOf(typed[i]?.unit)].filter((text) => text !== "").join(", "),
    }));
}
