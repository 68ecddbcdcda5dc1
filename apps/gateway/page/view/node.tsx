// SPDX-License-Identifier: BSL-1.0
// One node: its load, jobs, nouns, tasks and metrics.
import { Component, h } from "preact";
import { bytesText, durationText, isObject, Json, listOf, numberOf, numberText, objectOf, textOf } from "../decide/format";
import { isTold, plotRows, plotted, taskTimes, troubles } from "../decide/metrics";
import { hashOf, nounParts, requestPath } from "../decide/route";
import { nounsIn } from "../decide/series";
import { ask, failureText, poll } from "../io";
import { Notes } from "./fleet";
import { Empty, NodeLink, pretty, Stat, StateMark, Table, ViewProps } from "./parts";
import { Plot } from "./plot";

interface NodeViewState {
    jobs: Json;
    whyNoJobs: string;
    nouns: string[];
    whyNoNouns: string;
}

export class NodeView extends Component<ViewProps, NodeViewState> {
    state: NodeViewState = { jobs: null, whyNoJobs: "", nouns: [], whyNoNouns: "" };
    private stop: () => void = () => undefined;

    componentDidMount(): void {
        const name = this.props.parts[0];
        this.stop = poll(async () => {
            const jobs = await ask("GET", requestPath("pull", name, "cles", ["jobs"]), { deadlineMs: 2000 });
            const nouns = await ask("GET", requestPath("pull", name, "cles", ["nouns"]), { deadlineMs: 2000 });
            this.setState({
                jobs: jobs.status === 200 ? jobs.value : null, whyNoJobs: jobs.status === 200 ? "" : failureText(jobs),
                nouns: nouns.status === 200 ? nounsIn(nouns.value) : [], whyNoNouns: nouns.status === 200 ? "" : failureText(nouns),
            });
            return 1000;
        }, (wrong) => this.setState({ jobs: null, whyNoJobs: wrong, nouns: [], whyNoNouns: wrong }));
    }
    componentWillUnmount(): void {
        this.stop();
    }

    private nouns() {
        const { fleet, parts } = this.props;
        const node = fleet.nodes[parts[0]];
        const bound = node.tasks.filter((task) => task.verb === "BIND" && !this.state.nouns.some((noun) => nounParts(noun)[0] === task.task));
        const rows = [
            ...this.state.nouns.map((noun) => ({ parts: nounParts(noun), text: noun, has: "has a value" })),
            ...bound.map((task) => ({ parts: [task.task], text: task.task, has: "none yet" })),
        ];
        return rows.length === 0 ? <Empty text={this.state.whyNoNouns || "It publishes nothing."} /> : (
            <Table label="Nouns" heads={["noun", "value", "of all nodes"]} rows={rows.map((row) => [
                <a href={hashOf("noun", node.name, ...row.parts)}>{row.text}</a>, row.has, <a href={hashOf("noun", "all", ...row.parts)}>compare</a>,
            ])} />
        );
    }

    private jobs() {
        const jobs = listOf(objectOf(this.state.jobs).jobs).map(objectOf);
        if (this.state.jobs === null) {
            return <Empty text={this.state.whyNoJobs || "…"} />;
        }
        return jobs.length === 0 ? <Empty text="No job runs or waits." /> : (
            <Table label="Jobs" heads={["#job", "task", "requester", "state", "#age", "#time left", "progress"]} rows={jobs.slice(0, 200).map((job) => [
                numberOf(job.job), `${textOf(job.verb)} ${textOf(job.task)}`, textOf(job.requester), textOf(job.state),
                durationText(numberOf(job.age_ms)), job.deadline_ms === undefined ? "–" : durationText(numberOf(job.deadline_ms)),
                <progress value={String(numberOf(job.progress))} max="1" aria-label="progress" />,
            ])} />
        );
    }

    render({ fleet, parts, theme, now }: ViewProps) {
        const node = fleet.nodes[parts[0]];
        if (node === undefined) {
            return <div><h1>{parts[0]}</h1><Empty text="No node of this name has answered." /></div>;
        }
        const metrics = node.metrics;
        const memory = objectOf(metrics.memory);
        const wrong = troubles.filter((each) => (node.flat?.get(each.path) ?? 0) > 0);
        return (
            <div>
                <h1>{node.name} <StateMark node={node} /></h1>
                {node.why !== "" ? <p class="warning" role="alert">{node.why} (heard {durationText(now - node.seenAt)} ago)</p> : null}
                <div class="stats">
                    <Stat name="workers busy" value={node.load.workers > 0 ? `${node.load.running} of ${node.load.workers}` : "–"} />
                    <Stat name="jobs waiting" value={numberText(node.load.queued)} />
                    <Stat name="moved in / out" value={`${numberText(numberOf(metrics.jobs_moved_in))} / ${numberText(numberOf(metrics.jobs_moved_out))}`} hint="Jobs of other nodes that ran here, and jobs that were sent to others" />
                    <Stat name="links" value={isObject(metrics.memory) ? numberText(numberOf(metrics.links_open)) : "–"} />
                    <Stat name="memory for peers" value={bytesText(numberOf(memory.used))} hint={`of ${bytesText(numberOf(memory.limit))}`} />
                    <Stat name="up" value={durationText(node.uptimeMs)} />
                    <Stat name="version" value={node.version || "–"} />
                    <Stat name="pool" value={node.pool || "–"} />
                </div>
                {wrong.length > 0 ? <ul class="problems">{wrong.map((each) => (
                    <li class={`chip ${each.kind}`}>{each.text}, since its start: {numberText(node.flat?.get(each.path) ?? 0)}</li>
                ))}</ul> : null}
                <div class="columns">
                    <section><h2>Nouns it publishes</h2>{this.nouns()}</section>
                    <section><h2>Jobs</h2>{this.jobs()}</section>
                </div>
                <h2>Metrics</h2>
                {node.flat === null ? <Empty text="It has told none." /> : null}
                <div class="plots">
                    {plotted.filter((plot) => isTold(node.samples, plot)).map((plot) => (
                        <Plot key={plot.title} title={plot.title} unit={plot.unit} theme={theme} labels={plot.lines.map((line) => line.label)} rows={plotRows(node.samples, plot)} />
                    ))}
                </div>
                <div class="columns">
                    <section>
                        <h2>Tasks</h2>
                        <Table label="Tasks" heads={["request", "what it does", ""]} rows={node.tasks.map((task) => [
                            <a href={task.verb === "BIND" ? hashOf("noun", node.name, task.task) : hashOf("console", node.name, task.verb, task.task)}>{task.verb} {task.task}</a>,
                            task.description, [task.isSigned ? "signed" : "", task.isLocal ? "local" : ""].filter((text) => text !== "").join(", "),
                        ])} />
                    </section>
                    <section>
                        <h2>Times of tasks</h2>
                        {taskTimes(metrics).length === 0 ? <Empty text="None has run." /> : <Table label="Times of tasks" heads={["task", "#runs", "#p50", "#p99"]}
                            rows={taskTimes(metrics).map((each) => [`${each.verb} ${each.task}`, numberText(each.samples), durationText(each.p50 / 1000), durationText(each.p99 / 1000)])} />}
                        <h2>Nodes it hears</h2>
                        <Table label="Nodes it hears" heads={["node", "state", "#heard", "by way of"]} rows={fleet.edges.filter((edge) => edge.from === node.name).map((edge) => [
                            <NodeLink name={edge.to} />, edge.state, `${durationText(edge.ageMs)} ago`, edge.via || "–",
                        ])} />
                        <h2>What has happened</h2>
                        <Notes fleet={fleet} node={node.name} />
                    </section>
                </div>
                <details><summary>Addresses and all counters, as the node tells them</summary>
                    <p>{node.endpoints.join(" ") || "It listens nowhere."} · epoch {node.epoch}</p><pre>{pretty(metrics)}</pre></details>
            </div>
        );
    }
}
