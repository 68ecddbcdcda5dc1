// SPDX-License-Identifier: BSL-1.0
// A plot over time, by dygraphs.
import { Component, h } from "preact";
import Dygraph from "dygraphs/src/dygraph.js";
import { clockText, numberText, tickText } from "../decide/format";
import { Mark } from "../decide/series";

// Its legend writes styles as text, which the page's Content-Security-Policy forbids; the one below does not.
Dygraph.PLUGINS = Dygraph.PLUGINS.filter((each) => each !== Dygraph.Plugins.Legend);

/** Of Okabe and Ito, which the colour-blind tell apart; the dashes help, too. */
const colours = {
    light: ["#0072b2", "#d55e00", "#009e73", "#a0528a", "#7a6a00", "#3a8fc0", "#8a5a00", "#333333"],
    dark: ["#56b4e9", "#e69f00", "#2fc79b", "#e39ac6", "#f0e442", "#8fc7f2", "#ff8f4d", "#dddddd"],
};
const dashes = [null, [7, 3], [2, 2], [10, 3, 2, 3]];
export const colourOf = (i: number, theme: string): string => {
    const some = theme === "dark" ? colours.dark : colours.light;
    return some[i % some.length];
};
const dashOf = (i: number): number[] | null => dashes[(i + Math.floor(i / 8)) % dashes.length];

interface PlotProps {
    title: string;
    unit: string;
    labels: string[];
    rows: (number | null)[][];
    marks?: Mark[];
    theme: string;
    spanMs?: number;
    isStepped?: boolean;
}

export class Plot extends Component<PlotProps, { hovered: number }> {
    private box: HTMLElement | null = null;
    private made: Dygraph | null = null;
    state = { hovered: -1 };

    componentDidMount(): void {
        this.draw();
    }
    componentDidUpdate(before: PlotProps): void {
        if (this.made && (before.theme !== this.props.theme || before.labels.length !== this.props.labels.length)) {
            this.made.destroy();
            this.made = null;
        }
        if (!this.made || before.rows !== this.props.rows || before.rows.length !== this.props.rows.length) {
            this.draw();
        }
    }
    componentWillUnmount(): void {
        this.made?.destroy();
    }

    private options(): Record<string, unknown> {
        const { labels, rows, theme, spanMs, isStepped } = this.props;
        const last = rows.length > 0 ? Number(rows[rows.length - 1][0]) : 0;
        return {
            file: rows,
            labels: ["time", ...labels],
            ...(spanMs ? { dateWindow: [last - spanMs, last] } : {}),
            colors: labels.map((_, i) => colourOf(i, theme)),
            series: Object.fromEntries(labels.map((label, i) => [label, { strokePattern: dashOf(i) }])),
            stepPlot: isStepped ?? false,
        };
    }

    private draw(): void {
        const { rows, theme } = this.props;
        if (!this.box || rows.length === 0) {
            return;
        }
        if (this.made) {
            this.made.updateOptions(this.options());
            return;
        }
        const grid = theme === "dark" ? "#3a4350" : "#d5dae1";
        const { file, ...options } = this.options();
        this.made = new Dygraph(this.box, file as (number | null)[][], {
            ...options,
            connectSeparatedPoints: true,
            strokeWidth: 1.6,
            gridLineColor: grid,
            axisLineColor: grid,
            axisLabelFontSize: 11,
            axes: {
                x: { valueParser: Number, ticker: Dygraph.dateTicker, axisLabelFormatter: (at: number) => clockText(at), pixelsPerLabel: 80 },
                y: { axisLabelFormatter: (value: number) => tickText(value), axisLabelWidth: 62 },
            },
            animatedZooms: false,
            interactionModel: {}, // what comes in moves it
            highlightCallback: (_event: unknown, _x: number, _points: unknown, row: number) => this.setState({ hovered: row }),
            unhighlightCallback: () => this.setState({ hovered: -1 }),
            underlayCallback: (canvas: CanvasRenderingContext2D, area: { x: number; y: number; w: number; h: number }, graph: Dygraph) =>
                this.drawMarks(canvas, area, graph),
        });
    }

    private drawMarks(canvas: CanvasRenderingContext2D, area: { x: number; y: number; w: number; h: number }, graph: Dygraph): void {
        let labelled = -Infinity;
        for (const mark of this.props.marks ?? []) {
            const x = graph.toDomXCoord(mark.at);
            if (x >= area.x && x <= area.x + area.w) {
                canvas.save();
                canvas.strokeStyle = canvas.fillStyle = this.props.theme === "dark" ? "#ff8f4d" : "#b34700";
                canvas.setLineDash(mark.kind === "restart" ? [] : [4, 3]);
                canvas.beginPath();
                canvas.moveTo(x, area.y);
                canvas.lineTo(x, area.y + area.h);
                canvas.stroke();
                canvas.font = "11px sans-serif";
                if (mark.kind !== "back" && (mark.kind === "restart" || x - labelled > 32)) { // "back" ends what the one before says
                    labelled = x;
                    canvas.fillText(mark.kind, Math.min(x + 3, area.x + area.w - 36), area.y + (mark.kind === "restart" ? 23 : 11));
                }
                canvas.restore();
            }
        }
    }

    render() {
        const { title, unit, labels, rows, theme } = this.props;
        const at = rows[this.state.hovered] ? this.state.hovered : rows.length - 1;
        const valueAt = (i: number): string => { // that row may be of another publisher
            const found = rows.slice(Math.max(0, at - 64), at + 1).reverse().find((row) => row[i + 1] !== null);
            const value = found?.[i + 1];
            return typeof value === "number" && Number.isFinite(value) ? numberText(value) : "–";
        };
        return (
            <figure class="plot">
                <figcaption>
                    <b>{title}</b> {unit ? <span class="unit">{unit}</span> : null}
                    <span class="legend">
                        {labels.map((label, i) => (
                            <span class="line">
                                <svg width="22" height="8" aria-hidden="true">
                                    <line x1="0" x2="22" y1="4" y2="4" stroke={colourOf(i, theme)} stroke-width="2.5" stroke-dasharray={dashOf(i)?.join(" ") ?? "none"} />
                                </svg>{" "}
                                {label} <b>{valueAt(i)}</b>
                            </span>
                        ))}
                    </span>
                </figcaption>
                <div class="canvas" ref={(box?: Element) => { this.box = (box as HTMLElement | undefined) ?? null; }} role="img"
                    aria-label={`${title}: ${labels.map((label, i) => `${label} ${valueAt(i)}`).join(", ")}`} />
            </figure>
        );
    }
}
