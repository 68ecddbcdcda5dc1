// SPDX-License-Identifier: BSL-1.0
// The fleet: a live map of nodes, links and pools, and what has happened.
import { Component, h } from "preact";
import { Edge, Fleet, FleetNode, sortedNodes } from "../decide/fleet";
import { clockText, count, durationText } from "../decide/format";
import { Layout, layoutOf } from "../decide/layout";
import { hashOf } from "../decide/route";
import { Empty, NodeLink, StateMark, stateMarks, stateOf, Table, ViewProps } from "./parts";

const mostWithEdges = 24; // of more nodes, only the edges of one are shown

interface MapProps {
    fleet: Fleet;
    nodes: FleetNode[];
    gateway: string;
}

class FleetMap extends Component<MapProps, { chosen: string; wide: number }> {
    state = { chosen: "", wide: 900 };
    private box: Element | null = null;

    componentDidMount(): void {
        this.measure();
        window.addEventListener("resize", this.measure);
    }
    componentWillUnmount(): void {
        window.removeEventListener("resize", this.measure);
    }
    private measure = (): void => {
        this.setState({ wide: Math.max(this.box?.clientWidth ?? 900, 320) });
    };

    private edges(layout: Layout): Edge[] {
        const { chosen } = this.state;
        const isShown = (edge: Edge): boolean => edge.from in layout.spots && edge.to in layout.spots && edge.from !== edge.to;
        return this.props.fleet.edges.filter((edge) => isShown(edge) &&
            (this.props.nodes.length <= mostWithEdges || edge.from === chosen || edge.to === chosen));
    }

    render({ nodes, gateway }: MapProps) {
        const { chosen, wide } = this.state;
        const names = [...new Set(nodes.map((node) => node.pool))];
        const layout = layoutOf(names.map((pool) => ({ pool, nodes: nodes.filter((node) => node.pool === pool).map((node) => node.name) })), wide);
        return (
            <div class="map" ref={(box?: Element) => { this.box = box ?? null; }}>
                <svg viewBox={`0 0 ${layout.width} ${layout.height}`} style={{ maxWidth: `${layout.width}px` }} role="group" aria-label="Map of the fleet">
                    {layout.boxes.map((box) => (
                        <g>
                            <rect class="pool" x={box.x} y={box.y} width={box.width} height={box.height} rx="12" />
                            <text class="pool" x={box.x + 12} y={box.y + 19}>{box.pool !== "" ? `pool ${box.pool}` : names.length > 1 ? "no pool" : ""}</text>
                        </g>
                    ))}
                    {this.edges(layout).map((edge) => {
                        const [from, to] = [layout.spots[edge.from], layout.spots[edge.to]];
                        const kind = edge.state === "suspect" ? "suspect" : edge.state === "clash" ? "clash" : edge.via ? "routed" : "live";
                        const isFaint = chosen !== "" && edge.from !== chosen && edge.to !== chosen;
                        return <line class={`edge ${kind} ${isFaint ? "faint" : ""}`} x1={from.x} y1={from.y} x2={to.x} y2={to.y} />;
                    })}
                    {nodes.map((node) => this.node(node, layout, node.name === gateway))}
                </svg>
            </div>
        );
    }

    private node(node: FleetNode, layout: Layout, isGateway: boolean) {
        const spot = layout.spots[node.name];
        const state = stateOf(node);
        const { running, queued, workers } = node.load;
        const share = workers > 0 ? Math.min(running / workers, 1) : 0;
        const around = 2 * Math.PI * 23;
        const choose = (chosen: string) => (): void => this.setState({ chosen });
        return (
            <a key={node.name} href={hashOf("node", node.name)} class={`node ${state}`} onMouseEnter={choose(node.name)} onMouseLeave={choose("")}
                onFocus={choose(node.name)} onBlur={choose("")}
                aria-label={`${node.name}: ${stateMarks[state].text}${workers > 0 ? `, ${running} of ${workers} workers busy, ${queued} queued` : ""}`}>
                <title>{`${node.name}: ${node.why || stateMarks[state].text}`}</title>
                {workers > 0 ? <circle class="load" cx={spot.x} cy={spot.y} r="23" stroke-dasharray={`${share * around} ${around}`}
                    transform={`rotate(-90 ${spot.x} ${spot.y})`} /> : null}
                {isGateway
                    ? <rect class="body" x={spot.x - 17} y={spot.y - 17} width="34" height="34" rx="6" />
                    : <circle class="body" cx={spot.x} cy={spot.y} r="18" />}
                <text class="sign" x={spot.x} y={spot.y + 5}>{state === "live" && queued > 0 ? queued : stateMarks[state].sign}</text>
                <text class="name" x={spot.x} y={spot.y + 40}>{node.name.length > 13 ? node.name.slice(0, 12) + "…" : node.name}</text>
            </a>
        );
    }
}

const sentences: Record<string, string> = { lost: "lost", left: "left", back: "back", new: "new", restart: "restart", clash: "clash", refused: "refused", drop: "dropped" };

export function Notes({ fleet, node }: { fleet: Fleet; node?: string }) {
    const notes = fleet.notes.filter((note) => node === undefined || note.node === node).slice(-30).reverse();
    return notes.length === 0 ? <Empty text="Nothing has happened since this page was opened." /> : (
        <ul class="notes">
            {notes.map((note) => (
                <li>
                    <time>{clockText(note.at)}</time> <span class={`tag ${note.kind}`}>{sentences[note.kind]}</span>{" "}
                    <NodeLink name={note.node} /> {note.text}{note.by > 0 ? `: ${note.by}` : ""}
                </li>
            ))}
        </ul>
    );
}

export function FleetView({ fleet, session, now, forget }: ViewProps & { forget: (name: string) => void }) {
    const nodes = sortedNodes(fleet);
    const shown = nodes.filter((node) => node.state !== "left");
    const live = nodes.filter((node) => node.state === "live").length;
    return (
        <div>
            <h1>The fleet <small>{count(live, "node")} live{nodes.length > live ? `, ${nodes.length - live} not` : ""}</small></h1>
            {nodes.length === 0 ? <Empty text="No node has answered yet. Start one: cles serve" /> : null}
            <div class={`columns ${shown.length > 10 || new Set(shown.map((node) => node.pool)).size > 1 ? "wide" : ""}`}>
                <section>
                    {nodes.length === 0 ? null : <FleetMap fleet={fleet} nodes={shown} gateway={session.node} />}
                    <p class="key">
                        A line: one node hears the other (dotted: through others; dashed: not at the moment). A ring: how many workers are
                        busy. A number: jobs that wait. A square: this gateway.
                        {shown.length > mostWithEdges ? " Point at a node to see its lines." : ""}
                    </p>
                </section>
                <section>
                    <h2>Nodes</h2>
                    <Table label="Nodes" heads={["node", "pool", "state", "#running", "#queued", "#workers", "up", "version", ""]} rows={nodes.map((node) => [
                        <NodeLink name={node.name} />, node.pool || "–", <StateMark node={node} />,
                        ...(node.load.workers > 0 ? [node.load.running, node.load.queued, node.load.workers] : ["–", "–", "–"]),
                        node.state === "live" ? durationText(node.uptimeMs) : `heard ${durationText(now - node.seenAt)} ago`, node.version,
                        node.state === "lost" || node.state === "left"
                            ? <button class="small" onClick={() => forget(node.name)} aria-label={`Forget ${node.name}`}>forget</button> : null,
                    ])} />
                    {fleet.pools.length > 0 ? <h2>Pools that bridges reach</h2> : null}
                    {fleet.pools.length > 0 ? <Table label="Pools" heads={["bridge", "pool", "state", "#nodes"]}
                        rows={fleet.pools.map((each) => [<NodeLink name={each.bridge} />, each.pool || "–", each.state, each.nodes])} /> : null}
                    <h2>What has happened</h2>
                    <Notes fleet={fleet} />
                </section>
            </div>
        </div>
    );
}
