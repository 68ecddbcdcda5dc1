// SPDX-License-Identifier: BSL-1.0
// A noun: live plots of its numbers, a map where it has positions, and the rest as a table.
import { Component, h } from "preact";
import { thinned } from "../decide/events";
import { clockText, isInstant, Json, numberText, objectOf, rateText, valueText } from "../decide/format";
import { hashOf, requestPath } from "../decide/route";
import { Meaning, meaningAt, meaningsOf } from "../decide/schema";
import { pathIn, plotGroups, projected, scaleLength, Series } from "../decide/series";
import { ask, follow } from "../io";
import { Empty, Stat, Table, ViewProps } from "./parts";
import { colourOf, Plot } from "./plot";

interface NounState {
    every: number;
    spanMs: number;
    isPaused: boolean;
    wrong: string;
    drawn: number; // how often; each draws again
    meanings: Map<string, Meaning>;
}

const leastPause = 100; // ms between two drawings

function TrackMap({ series, theme }: { series: Series; theme: string }) {
    const { lines, half } = projected(series.tracks);
    const size = 300;
    const at = (value: number): number => (value / half) * (size / 2);
    const scale = scaleLength(half / 1.5);
    return (
        <figure class="track">
            <figcaption><b>Map</b> <span class="unit">north is up</span></figcaption>
            <svg viewBox={`${-size / 2} ${-size / 2} ${size} ${size}`} role="img" aria-label={`Map of ${lines.length} tracks`}>
                {lines.map(({ name, points }, i) => {
                    const [x, y] = points[points.length - 1];
                    return (
                        <g key={name}>
                            <polyline points={points.map(([px, py]) => `${at(px).toFixed(1)},${at(-py).toFixed(1)}`).join(" ")} stroke={colourOf(i, theme)} />
                            <circle cx={at(x)} cy={at(-y)} r="5" fill={colourOf(i, theme)} />
                            <text x={at(x) + (x > 0 ? -8 : 8)} y={at(-y) - 6} text-anchor={x > 0 ? "end" : "start"}>{name}</text>
                        </g>
                    );
                })}
                <path class="scale" d={`M${-size / 2 + 12} ${size / 2 - 14} v6 h${at(scale)} v-6`} />
                <text x={-size / 2 + 16} y={size / 2 - 14}>{scale >= 1000 ? `${numberText(scale / 1000)} km` : `${numberText(scale)} m`}</text>
            </svg>
        </figure>
    );
}

export class NounView extends Component<ViewProps, NounState> {
    state: NounState = { every: 50, spanMs: 60_000, isPaused: false, wrong: "", drawn: 0, meanings: new Map() };
    private series = new Series(false);
    private stop: () => void = () => undefined;
    private timer = 0;
    private pause = leastPause;
    private begunWith = -1; // ms
    private learntOf = "";
    private readonly onVisibility = (): void => (document.hidden ? this.stop() : this.begin());

    componentDidMount(): void {
        this.series = new Series(this.isOfAll(), this.state.spanMs);
        document.addEventListener("visibilitychange", this.onVisibility);
        this.begin();
        void this.learnTypes();
    }
    componentDidUpdate(): void { // the fleet may be known only now
        if (this.every() !== this.begunWith && !document.hidden) {
            this.begin();
        }
        void this.learnTypes();
    }
    componentWillUnmount(): void {
        document.removeEventListener("visibilitychange", this.onVisibility);
        this.stop();
        clearTimeout(this.timer);
    }

    private isOfAll(): boolean {
        return this.props.parts[0] === "all" || (this.props.parts[0] ?? "").endsWith(".all");
    }
    private every(): number {
        const publishers = Object.values(this.props.fleet.nodes).filter((node) => node.tasks.some((task) => task.verb === "BIND" && task.task === this.props.parts[1]));
        return thinned(this.state.every, this.isOfAll() ? publishers.length : 1);
    }

    private begin(): void {
        this.stop();
        const [node, task, ...parameters] = this.props.parts;
        const every = this.begunWith = this.every();
        this.stop = follow(requestPath("bind", node, task ?? "", parameters) + (every > 0 ? `?every=${every}` : ""), (events) => {
            if (!this.state.isPaused) {
                events.forEach((event) => this.series.take(event, Date.now()));
                this.drawSoon();
            }
        }, (wrong) => {
            if (wrong !== "") {
                this.series.interrupt(Date.now(), wrong);
            }
            this.setState({ wrong });
        });
    }
    private drawSoon(): void {
        if (this.timer === 0) {
            this.timer = window.setTimeout(() => {
                this.timer = 0;
                const begun = performance.now();
                this.setState((state: NounState) => ({ drawn: state.drawn + 1 }), () => { // most of the time is the browser's
                    this.pause = Math.max(leastPause, 4 * (performance.now() - begun));
                });
            }, this.pause);
        }
    }
    private async learnTypes(): Promise<void> {
        const [node, task] = this.props.parts;
        const asked = this.isOfAll() ? "any" : node;
        const nodes = Object.values(this.props.fleet.nodes);
        const one = asked === "any" ? nodes.find((each) => each.tasks.some((some) => some.verb === "BIND" && some.task === task))?.name : asked;
        if (one !== undefined && task !== undefined && one in this.props.fleet.nodes && this.learntOf !== one) {
            this.learntOf = one;
            const reply = await ask("GET", requestPath("pull", one, "cles", ["types", task]), { deadlineMs: 3000 });
            const told = objectOf(reply.value);
            const updates = objectOf(told.BIND).updates ?? objectOf(told.UPDATE).updates;
            if (reply.status === 200 && updates !== undefined) {
                this.setState({ meanings: meaningsOf(updates) });
            }
        }
    }

    private meaning = (name: string): Meaning => meaningAt(this.state.meanings, pathIn(name, this.isOfAll()));

    private plots() {
        const { theme } = this.props;
        const series = this.series;
        const latestOf = (name: string): Json | undefined => {
            const publisher = this.isOfAll() ? name.slice(0, name.indexOf(" ")) : "";
            return series.latest[publisher]?.get(pathIn(name, this.isOfAll()));
        };
        const isHidden = (name: string): boolean => {
            const value = latestOf(name);
            const isPosition = Object.keys(series.tracks).length > 0 && /(^|[. ])(lat|latitude|lon|lng|longitude)$/.test(name);
            return isPosition || (typeof value === "number" && isInstant(value, this.meaning(name).unit || (/(^|[. ])utc$/.test(name) ? "s" : "")));
        };
        return plotGroups(series.names, (name) => this.meaning(name).unit || pathIn(name, this.isOfAll()), isHidden).map((group) => {
            const names = group.columns.map((column) => series.names[column]);
            const paths = [...new Set(names.map((name) => pathIn(name, this.isOfAll())))];
            return (
                <Plot key={`${group.unit} ${names[0]}`} title={paths.length > 3 ? `${paths.slice(0, 3).join(", ")}…` : paths.join(", ")} unit={this.meaning(names[0]).unit}
                    labels={this.isOfAll() && paths.length === 1 ? names.map((name) => name.slice(0, name.indexOf(" "))) : names}
                    rows={series.rows.map((row) => [row[0], ...group.columns.map((column) => row[column + 1] ?? null)])}
                    marks={series.marks} theme={theme} spanMs={this.state.spanMs} />
            );
        });
    }

    private table() {
        const rows = Object.keys(this.series.latest).flatMap((publisher) =>
            [...this.series.latest[publisher]].map(([path, value]) => {
                const { unit, description } = meaningAt(this.state.meanings, path);
                const range = this.series.ranges.get(publisher === "" ? path : `${publisher} ${path}`);
                const isTime = typeof value === "number" && isInstant(value, unit);
                return [...(this.isOfAll() ? [publisher] : []), path || "value", valueText(value, unit), isTime ? "" : unit,
                    range && !isTime ? valueText(range.least) : "", range && !isTime ? valueText(range.most) : "", description];
            }));
        return <Table label="Values" heads={[...(this.isOfAll() ? ["node"] : []), "value of", "#now", "unit", "#least", "#most", "meaning"]} rows={rows.slice(0, 300)} />;
    }

    render({ parts, theme }: ViewProps) {
        const [node, ...noun] = parts;
        const series = this.series;
        const { every, spanMs, isPaused, wrong } = this.state;
        const { arrive, published } = series.rates(Date.now());
        const trouble = wrong || series.failure || (series.isLost ? "The publisher is not there. The gateway tries again." : "");
        return (
            <div>
                <h1>{noun.join("/")} <small>of {node === "all" ? "all nodes" : <a href={hashOf("node", node)}>{node}</a>}</small></h1>
                <div class="controls">
                    <label>at most one update in <select value={String(every)} onChange={(event) => this.setState({ every: Number((event.target as HTMLSelectElement).value) })}>
                        {[0, 20, 50, 100, 250, 1000, 5000].map((ms) => <option value={String(ms)} selected={ms === every}>{ms === 0 ? "no time: show each" : `${ms} ms`}</option>)}
                    </select></label>
                    <label>show the last <select onChange={(event) => { const ms = Number((event.target as HTMLSelectElement).value); series.setSpan(ms); this.setState({ spanMs: ms }); }}>
                        {[10_000, 60_000, 300_000, 900_000].map((ms) => <option value={String(ms)} selected={ms === spanMs}>{ms < 60_000 ? `${ms / 1000} s` : `${ms / 60_000} min`}</option>)}
                    </select></label>
                    <button aria-pressed={isPaused} onClick={() => this.setState({ isPaused: !isPaused })}>{isPaused ? "go on" : "pause"}</button>
                    <a href={hashOf("noun", node === "all" ? Object.keys(series.latest)[0] ?? "all" : "all", ...noun)}>{node === "all" ? "only one node" : "compare all nodes"}</a>
                </div>
                {trouble !== "" ? <p class="warning" role="alert">{trouble}</p> : null}
                <div class="stats">
                    <Stat name="arrive" value={rateText(arrive)} />
                    {this.isOfAll() ? null : <Stat name="published" value={rateText(published)} hint="As the numbers of the updates tell" />}
                    <Stat name="thinned to" value={this.every() > 0 ? `1 in ${this.every()} ms` : "not"} hint="By the gateway, so that the browser keeps up" />
                    <Stat name="missed" value={this.every() > 0 && series.missed === 0 ? "not told if thinned" : numberText(series.missed)} />
                    <Stat name="gaps and restarts" value={numberText(series.marks.filter((mark) => mark.kind !== "back").length)} />
                </div>
                {series.received === 0 ? <Empty text="No update yet." /> : null}
                <div class="plots">
                    {Object.keys(series.tracks).length > 0 ? <TrackMap series={series} theme={theme} /> : null}
                    {this.plots()}
                </div>
                {series.received > 0 ? <h2>Values</h2> : null}
                {series.received > 0 ? this.table() : null}
                {series.marks.length > 0 ? <h2>Gaps and restarts</h2> : null}
                <ul class="notes">{series.marks.slice(-20).reverse().map((mark) => (
                    <li><time>{clockText(mark.at)}</time> <span class={`tag ${mark.kind}`}>{mark.kind}</span> {mark.text}</li>
                ))}</ul>
                {series.raw !== "" ? <details open><summary>The last line, as it came</summary><pre class="raw">{series.raw.length > 20_000 ? series.raw.slice(0, 20_000) + "…" : series.raw}</pre></details> : null}
                {this.state.meanings.size === 0 && series.received > 0 ? <p class="key">The publisher tells no types of this noun, so units are not known.</p> : null}
            </div>
        );
    }
}
