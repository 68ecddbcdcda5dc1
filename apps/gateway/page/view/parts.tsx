// SPDX-License-Identifier: BSL-1.0
// What views share.
import { h } from "preact";
import { Fleet, FleetNode, NodeState } from "../decide/fleet";
import { Json } from "../decide/format";
import { hashOf } from "../decide/route";

export interface Session {
    node: string;
    name: string;
    secured: boolean;
}
export interface ViewProps {
    fleet: Fleet;
    session: Session;
    parts: string[];
    now: number;
    theme: string;
}

/** Shapes and words beside colours, for whoever does not tell these apart. */
export const stateMarks: Record<NodeState | "clash", { sign: string; text: string }> = {
    live: { sign: "✓", text: "live" },
    suspect: { sign: "?", text: "does not answer" },
    lost: { sign: "✕", text: "lost" },
    left: { sign: "–", text: "has left" },
    clash: { sign: "!", text: "two nodes have this name" },
};

export const stateOf = (node: FleetNode): NodeState | "clash" => (node.isClash ? "clash" : node.state);

export function StateMark({ node }: { node: FleetNode }) {
    const state = stateOf(node);
    return (
        <span class={`state ${state}`} title={node.why || stateMarks[state].text}>
            <span class="sign" aria-hidden="true">{stateMarks[state].sign}</span> {stateMarks[state].text}
        </span>
    );
}

export const NodeLink = ({ name }: { name: string }) => <a href={hashOf("node", name)}>{name}</a>;

export function Table({ heads, rows, label }: { heads: string[]; rows: (JSX.Element | string | number | null)[][]; label: string }) {
    return (
        <div class="scroll" tabIndex={0} role="region" aria-label={label}>
            <table>
                <thead>
                    <tr>{heads.map((head) => <th scope="col" class={head.startsWith("#") ? "number" : ""}>{head.replace("#", "")}</th>)}</tr>
                </thead>
                <tbody>
                    {rows.map((row) => (
                        <tr>{row.map((cell, i) => <td class={heads[i].startsWith("#") ? "number" : ""}>{cell}</td>)}</tr>
                    ))}
                </tbody>
            </table>
        </div>
    );
}

export const Stat = ({ name, value, hint }: { name: string; value: string; hint?: string }) => (
    <div class="stat" title={hint ?? ""}>
        <span class="name">{name}</span>
        <span class="value">{value}</span>
    </div>
);

export const pretty = (value: Json): string => (typeof value === "string" ? value : JSON.stringify(value, null, 2));

export const Empty = ({ text }: { text: string }) => <p class="empty">{text}</p>;
