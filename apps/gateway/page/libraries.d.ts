// SPDX-License-Identifier: BSL-1.0
// What the page uses of dygraphs, for the type check.
declare module "dygraphs/src/dygraph.js" {
    export default class Dygraph {
        static PLUGINS: unknown[];
        static Plugins: { Legend: unknown };
        static dateTicker: unknown;
        constructor(where: HTMLElement, rows: (number | null)[][], options: Record<string, unknown>);
        updateOptions(options: Record<string, unknown>): void;
        toDomXCoord(x: number): number;
        destroy(): void;
    }
}
declare module "*.css";
