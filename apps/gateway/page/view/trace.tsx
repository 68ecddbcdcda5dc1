// SPDX-License-Identifier: BSL-1.0
// A trace as a waterfall.
import { Component, h } from "preact";
import { clockText, durationText, objectOf } from "../decide/format";
import { hashOf } from "../decide/route";
import { Bar, endOf, isTraceId, spansIn, waterfall } from "../decide/trace";
import { ask, failureText } from "../io";
import { recentTraces } from "./console";
import { Empty, ViewProps } from "./parts";

interface TraceState {
    bars: Bar[];
    wrong: string;
    typed: string;
    shown: string;
}

const us = (value: number): string => durationText(value / 1000);

export class TraceView extends Component<ViewProps, TraceState> {
    state: TraceState = { bars: [], wrong: "", typed: "", shown: "" };

    componentDidMount(): void {
        void this.load();
    }
    componentDidUpdate(): void {
        if ((this.props.parts[0] ?? "") !== this.state.shown) {
            void this.load();
        }
    }

    private load = async (): Promise<void> => {
        const id = this.props.parts[0] ?? "";
        this.setState({ shown: id, typed: id, bars: [], wrong: id !== "" && !isTraceId(id) ? "A trace has 32 digits from 0 to f." : "" });
        if (!isTraceId(id)) {
            return;
        }
        const reply = await ask("GET", `/pull/all/cles/trace/${id}`, { deadlineMs: 3000 });
        if ((this.props.parts[0] ?? "") === id) {
            const bars = waterfall(spansIn(objectOf(reply.value).results ?? {}));
            const none = "No node remembers this trace: nodes keep spans for a minute, and record those that say so only.";
            this.setState({ bars, wrong: reply.status !== 200 ? failureText(reply) : bars.length === 0 ? none : "" });
        }
    };

    private row(bar: Bar, end: number) {
        const share = (value: number): string => `${(100 * value) / end}%`;
        const total = bar.totalUs ?? end - bar.startUs;
        const text = `${bar.node} ${bar.isReceived ? "received" : "sent"} ${bar.label}: ${bar.totalUs === null ? "not ended" : us(total)}, ${bar.outcome || "no outcome"}`;
        return (
            <li aria-label={text} title={`${text}${bar.isReceived ? `; waited ${us(bar.queueUs)}, ran ${us(bar.runUs)}` : ""}`}>
                <span class="what" style={{ paddingLeft: `${bar.depth * 14}px` }}>
                    <b>{bar.node}</b> <span class="kind">{bar.isReceived ? "▸" : "⇢"}</span> {bar.label}
                </span>
                <span class="lane">
                    <span class={`bar ${bar.isReceived ? "received" : "sent"} ${bar.outcome === "ok" ? "" : "bad"}`} style={{ left: share(bar.startUs), width: share(Math.max(total, end / 400)) }}>
                        {bar.isReceived && total > 0 ? <span class="queue" style={{ width: `${Math.min(100, (100 * bar.queueUs) / total)}%` }} /> : null}
                        {bar.isReceived && total > 0 ? <span class="run" style={{ width: `${Math.min(100, (100 * bar.runUs) / total)}%` }} /> : null}
                    </span>
                </span>
                <span class="time">{bar.totalUs === null ? "…" : us(total)} {bar.outcome !== "ok" ? <b class="problem">{bar.outcome || "not ended"}</b> : null}</span>
            </li>
        );
    }

    render() {
        const { bars, wrong, typed } = this.state;
        const end = endOf(bars);
        const traces = recentTraces();
        return (
            <div>
                <h1>Trace <small>all that one request has caused</small></h1>
                <form class="controls" onSubmit={(event) => { event.preventDefault(); location.hash = hashOf("trace", typed.trim()); void this.load(); }}>
                    <label>id <input class="id" value={typed} onInput={(event) => this.setState({ typed: (event.target as HTMLInputElement).value })} placeholder="32 digits, as cles trace prints" /></label>
                    <button type="submit">show</button>
                </form>
                {wrong !== "" ? <p class="warning" role="alert">{wrong}</p> : null}
                {bars.length > 0 ? (
                    <figure class="waterfall">
                        <figcaption>▸ received, ⇢ sent; hatched: it waited; filled: its handler ran. {us(end)} in all. The clocks of nodes are not compared: what was received is in the middle of what was sent.</figcaption>
                        <ol>{bars.map((bar) => this.row(bar, end))}</ol>
                    </figure>
                ) : null}
                <h2>Asked from this page</h2>
                {traces.length === 0 ? <Empty text="Requests of the console are traced, and listed here." /> : (
                    <ul class="notes">{traces.map((each) => <li><time>{clockText(each.at)}</time> <a href={hashOf("trace", each.id)}>{each.text}</a></li>)}</ul>
                )}
            </div>
        );
    }
}
