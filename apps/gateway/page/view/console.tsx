// SPDX-License-Identifier: BSL-1.0
// The console: PULL, PUSH, DELEGATE and UPDATE, with forms from the types that a node tells.
import { Component, h } from "preact";
import { FleetNode, sortedNodes, Task } from "../decide/fleet";
import { clockText, durationText, Json, objectOf } from "../decide/format";
import { hashOf, requestPath } from "../decide/route";
import { bodyOf, Field, fieldOf, inputOf, Inputs, parameterNames, Problem } from "../decide/schema";
import { newTrace } from "../decide/trace";
import { ask, delegate, Reply } from "../io";
import { Empty, pretty, ViewProps } from "./parts";

export interface Result {
    number: number;
    text: string;
    at: number;
    trace: string;
    reply: Reply | null; // null: it runs
    fraction: number;
    details: Json;
    abort: AbortController;
}
/** What was asked outlives the view. */
const results: Result[] = [];
let requests = 0;
export const recentTraces = (): { id: string; text: string; at: number }[] => results.map((each) => ({ id: each.trace, text: each.text, at: each.at }));

interface ConsoleState {
    types: Json; // of the task
    parameters: string[];
    inputs: Inputs;
    isRaw: boolean;
    raw: string;
    deadline: string;
    problems: Problem[];
    drawn: number;
}
const verbs = ["PULL", "PUSH", "DELEGATE", "UPDATE"];
const cleared = { parameters: [], inputs: {}, isRaw: false, raw: "", problems: [] };

export class ConsoleView extends Component<ViewProps, ConsoleState> {
    state: ConsoleState = { types: null, ...cleared, deadline: "", drawn: 0 };
    private learnt = "";

    componentDidMount(): void {
        document.addEventListener("keydown", this.onKey);
        void this.learnTypes();
    }
    componentDidUpdate(): void {
        void this.learnTypes();
    }
    componentWillUnmount(): void {
        document.removeEventListener("keydown", this.onKey);
    }

    private onKey = (event: KeyboardEvent): void => {
        if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
            void this.send();
        } else if (event.key === "Escape") {
            results.filter((each) => each.reply === null).forEach((each) => each.abort.abort());
        }
    };

    /** What is chosen, by the address of the page. */
    private chosen(): { node: string; verb: string; task: string; told: Task | undefined } {
        const [node = "any", verb = "PULL", task = ""] = this.props.parts;
        const told = this.offering(node).flatMap((each) => each.tasks).find((each) => each.verb === verb && each.task === task);
        return { node, verb, task, told };
    }
    private offering(node: string): FleetNode[] {
        const nodes = sortedNodes(this.props.fleet).filter((each) => each.state === "live");
        return node === "any" || node === "all" ? nodes : nodes.filter((each) => each.name === node);
    }
    private choose(change: { node?: string; verb?: string; task?: string }): void {
        const { node, verb, task } = { ...this.chosen(), ...change };
        location.hash = hashOf("console", node, verb, task);
    }

    private async learnTypes(): Promise<void> {
        const { node, verb, task } = this.chosen();
        const one = this.offering(node).find((each) => each.tasks.some((some) => some.verb === verb && some.task === task));
        const key = [node, verb, task, one?.name, one?.types].join(" ");
        if (key === this.learnt || (one === undefined && this.learnt.startsWith([node, verb, task].join(" ")))) {
            return;
        }
        this.learnt = key;
        this.setState({ types: null, ...cleared });
        if (one !== undefined && task !== "") {
            const reply = await ask("GET", requestPath("pull", one.name, "cles", ["types", task]), { deadlineMs: 3000 });
            if (this.learnt === key) {
                this.setState({ types: reply.status === 200 ? objectOf(reply.value)[verb] ?? null : null });
            }
        }
    }

    private form(): Field | null {
        const { verb } = this.chosen();
        const told = objectOf(this.state.types);
        const schema = verb === "UPDATE" ? told.body ?? told.updates : told.body;
        return verb === "PULL" || schema === undefined ? null : fieldOf(schema);
    }

    private body(): string | undefined {
        const form = this.form();
        const problems: Problem[] = [];
        let text: string | undefined;
        if (this.chosen().verb === "PULL") {
            text = undefined;
        } else if (this.state.isRaw || form === null) {
            text = bodyOf({ ...fieldOf({}), label: "body", isRequired: false }, { "": this.state.raw }, problems);
        } else {
            text = bodyOf(form, this.state.inputs, problems);
        }
        if (this.state.deadline !== "" && !/^[1-9]\d{0,7}$/.test(this.state.deadline)) {
            problems.push({ path: "deadline", text: "the time limit is a number of milliseconds" });
        }
        this.setState({ problems });
        return problems.length > 0 ? undefined : text ?? "";
    }

    private send = async (): Promise<void> => {
        const { node, verb, task } = this.chosen();
        const body = this.body();
        if ((body === undefined && verb !== "PULL") || task === "") {
            return;
        }
        const parameters = [...this.state.parameters];
        while (parameters.length > 0 && !parameters[parameters.length - 1]) {
            parameters.pop();
        }
        const { id, stated } = newTrace(crypto.getRandomValues(new Uint8Array(24)));
        const noun = [`${node}:${task}`, ...parameters].join("/");
        const made: Result = {
            number: ++requests, text: `${verb} ${noun}${body ? ` ${body.length > 300 ? body.slice(0, 300) + "…" : body}` : ""}`, at: Date.now(), trace: id,
            reply: null, fraction: 0, details: {}, abort: new AbortController(),
        };
        results.unshift(made);
        results.splice(30).forEach((each) => each.abort.abort());
        this.draw();
        const path = requestPath(verb, node, task, parameters.map((each) => each ?? ""));
        const asked = { body: body || undefined, deadlineMs: Number(this.state.deadline) || undefined, trace: stated, signal: made.abort.signal };
        made.reply = verb === "DELEGATE"
            ? await delegate(path, asked, (fraction, details) => {
                  made.fraction = fraction;
                  made.details = details;
                  this.draw();
              })
            : await ask(verb === "PULL" ? "GET" : "POST", path, asked);
        this.draw();
    };
    private draw(): void {
        this.setState((state: ConsoleState) => ({ drawn: state.drawn + 1 }));
    }

    private input(field: Field): JSX.Element {
        const { inputs, problems } = this.state;
        const value = inputOf(field, inputs);
        const set = (event: Event): void => this.setState({ inputs: { ...inputs, [field.path]: (event.target as HTMLInputElement).value } });
        const problem = problems.find((each) => each.path === field.path);
        const id = `field-${field.path}`;
        if (field.kind === "object") {
            return (
                <fieldset key={field.path}>
                    {field.label !== "" ? <legend>{field.label}{field.isRequired ? "" : " (optional)"} <small>{field.description}</small></legend> : null}
                    {field.fields.length === 0 ? <Empty text="no members" /> : field.fields.map((each) => this.input(each))}
                </fieldset>
            );
        }
        const range = [field.minimum !== undefined ? `from ${field.minimum}` : "", field.maximum !== undefined ? `to ${field.maximum}` : ""].filter((text) => text !== "").join(" ");
        const some = field.kind === "boolean" ? ["true", "false"] : field.choices;
        const attributes = { id, value, onInput: set, "aria-invalid": problem ? "true" : "false", "aria-describedby": `${id}-about` };
        return (
            <div class="field" key={field.path}>
                <label for={id}>{field.label || "value"}{field.isRequired ? "" : " (optional)"}</label>
                {some.length > 0
                    ? <select {...attributes} onChange={set}>{field.isRequired && !field.isNullable ? null : <option value="" selected={value === ""}>–</option>}
                        {some.map((each) => <option value={each} selected={each === value}>{each.replace(/^"(.*)"$/, "$1")}</option>)}</select>
                    : field.kind === "json" ? <textarea {...attributes} rows={3} />
                        : <input {...attributes} inputMode={field.kind === "number" || field.kind === "integer" ? "decimal" : "text"} placeholder={field.kind === "time" ? "ISO 8601, or seconds" : field.isNullable ? "null" : ""} />}
                <span class="unit">{field.unit}</span>
                <small id={`${id}-about`} class={problem ? "problem" : ""}>{problem ? problem.text : [field.description, range].filter((text) => text !== "").join("; ")}</small>
            </div>
        );
    }

    private chooser() {
        const { node, verb, task } = this.chosen();
        const nodes = sortedNodes(this.props.fleet);
        const tasks = [...new Map(this.offering(node).flatMap((each) => each.tasks).filter((each) => each.verb === verb).map((each) => [each.task, each])).values()]
            .sort((a, b) => a.task.localeCompare(b.task));
        const chosen = (event: Event): string => (event.target as HTMLSelectElement).value;
        return (
            <div class="controls">
                <label>verb <select onChange={(event) => this.choose({ verb: chosen(event), task: "" })}>{verbs.map((each) => <option selected={each === verb}>{each}</option>)}</select></label>
                <label>node <select onChange={(event) => this.choose({ node: chosen(event) })}>
                    {[...new Set(["any", "all", ...nodes.map((each) => each.name), node])].map((each) => <option value={each} selected={each === node}>{each}</option>)}
                </select></label>
                <label>task <select onChange={(event) => this.choose({ task: chosen(event) })}>
                    <option value="" selected={task === ""}>choose…</option>
                    {tasks.map((each) => <option value={each.task} selected={each.task === task}>{each.task}</option>)}
                    {task !== "" && !tasks.some((each) => each.task === task) ? <option value={task} selected>{task} (not offered)</option> : null}
                </select></label>
            </div>
        );
    }

    render() {
        const { node, verb, task, told } = this.chosen();
        const form = this.form();
        const names = parameterNames(objectOf(this.state.types).parameters, told?.parameters ?? []);
        const { parameters, raw, isRaw, problems } = this.state;
        const toRaw = (): void => {
            const text = form ? bodyOf(form, this.state.inputs, []) : undefined;
            this.setState({ isRaw: !isRaw, raw: text !== undefined && !isRaw ? JSON.stringify(JSON.parse(text), null, 2) : raw });
        };
        return (
            <div>
                <h1>Console <small>ask a node for something</small></h1>
                {this.chooser()}
                <form onSubmit={(event) => { event.preventDefault(); void this.send(); }}>
                    {told?.description ? <p>{told.description}</p> : null}
                    {told?.isSigned ? <p class="warning">This task needs the signature of its requester. The gateway cannot sign for another, so it will be denied: use the command cles with your key.</p> : null}
                    {names.map((name, i) => (
                        <div class="field">
                            <label for={`parameter-${i}`}>{name.name} <small>(parameter)</small></label>
                            <input id={`parameter-${i}`} value={parameters[i] ?? ""} onInput={(event) => {
                                const changed = [...parameters];
                                changed[i] = (event.target as HTMLInputElement).value;
                                this.setState({ parameters: changed });
                            }} />
                            <span class="unit" /><small>{name.description}</small>
                        </div>
                    ))}
                    {verb === "PULL" || task === "" ? null : form !== null && !isRaw ? this.input(form) : (
                        <div class="field wide">
                            <label for="field-">body, as JSON</label>
                            <textarea id="field-" rows={5} value={raw} onInput={(event) => this.setState({ raw: (event.target as HTMLTextAreaElement).value })} />
                            <small>{form === null ? "The node tells no type of the body." : ""}</small>
                        </div>
                    )}
                    {problems.length > 0 ? <p class="problem" role="alert">{problems.map((each) => `${each.path || "body"} ${each.text}`).join("; ")}</p> : null}
                    <div class="controls">
                        <button class="main" type="submit" disabled={task === ""}>{verb} {task === "" ? "" : `${node}:${task}`}</button>
                        <label>time limit <input class="short" value={this.state.deadline} placeholder="default" inputMode="numeric" onInput={(event) => this.setState({ deadline: (event.target as HTMLInputElement).value.trim() })} /> ms</label>
                        {form !== null ? <button type="button" onClick={toRaw}>{isRaw ? "use the form" : "edit as JSON"}</button> : null}
                        <span class="key">Ctrl+Enter sends, Escape cancels</span>
                    </div>
                </form>
                <h2>Answers</h2>
                {results.length === 0 ? <Empty text="Nothing has been asked yet." /> : null}
                <ol class="results" aria-live="polite">{results.map((each) => this.result(each))}</ol>
            </div>
        );
    }

    private result(each: Result) {
        const isGood = each.reply !== null && each.reply.status >= 200 && each.reply.status < 300;
        const state = each.reply === null ? "running" : isGood ? "done" : each.reply.status > 0 && each.reply.status !== 500 ? `failed (${each.reply.status})` : "failed";
        return (
            <li key={String(each.number)} class={each.reply === null ? "" : isGood ? "good" : "bad"}>
                <div class="head">
                    <time>{clockText(each.at)}</time> <code>{each.text}</code> <b>{isGood ? "✓ " : each.reply === null ? "" : "✕ "}{state}</b>
                    {each.reply ? ` in ${durationText(each.reply.ms)}` : null} <a href={hashOf("trace", each.trace)}>trace</a>
                    {each.reply === null ? <button class="small" onClick={() => each.abort.abort()}>cancel</button> : null}
                </div>
                {each.reply === null ? <progress value={String(each.fraction)} max="1" aria-label="progress" /> : null}
                {each.reply === null && Object.keys(objectOf(each.details)).length > 0 ? <pre>{pretty(each.details)}</pre> : null}
                {each.reply ? <pre>{pretty(each.reply.value)}</pre> : null}
            </li>
        );
    }
}
