// SPDX-License-Identifier: BSL-1.0
// Where the nodes are on the map: those of a pool in a circle, or in rows if they are many.

export interface Spot {
    x: number;
    y: number;
}
export interface PoolBox {
    pool: string;
    x: number;
    y: number;
    width: number;
    height: number;
}
export interface Layout {
    spots: Record<string, Spot>;
    boxes: PoolBox[];
    width: number;
    height: number;
}

const most = 24; // in a circle
const cell = { width: 96, height: 84 };
const margin = 28;
const caption = 26;

function sizeOf(count: number): { width: number; height: number; radius: number; columns: number } {
    if (count <= most) {
        const radius = count <= 1 ? 0 : Math.max(70, (count * cell.width) / (2 * Math.PI));
        return { width: 2 * radius + cell.width + 2 * margin, height: 2 * radius + cell.height + 2 * margin, radius, columns: 0 };
    }
    const columns = Math.ceil(Math.sqrt(count * 1.5));
    return { width: columns * cell.width + margin, height: Math.ceil(count / columns) * cell.height + margin, radius: 0, columns };
}

/** \param pools the names of their nodes, in order \param wide how wide the map may be */
export function layoutOf(pools: { pool: string; nodes: string[] }[], wide: number): Layout {
    const made: Layout = { spots: Object.create(null) as Record<string, Spot>, boxes: [], width: 0, height: 0 };
    let [x, y, row] = [0, 0, 0];
    for (const { pool, nodes } of pools) {
        const size = sizeOf(nodes.length);
        if (x > 0 && x + size.width > wide) {
            [x, y, row] = [0, y + row, 0];
        }
        const height = size.height + caption;
        nodes.forEach((name, i) => {
            const angle = (2 * Math.PI * i) / nodes.length - Math.PI / 2;
            made.spots[name] = size.columns > 0
                ? { x: x + margin / 2 + (i % size.columns + 0.5) * cell.width, y: y + caption + margin / 2 + (Math.floor(i / size.columns) + 0.4) * cell.height }
                : { x: x + size.width / 2 + size.radius * Math.cos(angle), y: y + caption + size.height / 2 - 8 + size.radius * Math.sin(angle) };
        });
        made.boxes.push({ pool, x: x + 4, y: y + 4, width: size.width - 8, height: height - 8 });
        x += size.width;
        row = Math.max(row, height);
        made.width = Math.max(made.width, x);
        made.height = y + row;
    }
    return made;
}
