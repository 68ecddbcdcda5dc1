// SPDX-License-Identifier: BSL-1.0
// What the page of the gateway decides, without a browser.
import { EventReader, markOf, thinned } from "../../../apps/gateway/page/decide/events";
import { Answers, emptyFleet, Fleet, fleetAfter, forgotten, problems, withResult } from "../../../apps/gateway/page/decide/fleet";
import { bytesText, durationText, Json, numberText, tickText, valueText } from "../../../apps/gateway/page/decide/format";
import { layoutOf } from "../../../apps/gateway/page/decide/layout";
import { flatNumbers, plotRows, plotted, risenTroubles, sampleOf, taskTimes } from "../../../apps/gateway/page/decide/metrics";
import { permits, rosterIn, verdict } from "../../../apps/gateway/page/decide/rights";
import { hashOf, nounParts, placeOf, requestPath } from "../../../apps/gateway/page/decide/route";
import { bodyOf, exampleOf, fieldOf, Inputs, meaningAt, meaningsOf, parameterNames, Problem } from "../../../apps/gateway/page/decide/schema";
import { plotGroups, positionIn, projected, scaleLength, Series } from "../../../apps/gateway/page/decide/series";
import { endOf, isTraceId, newTrace, spansIn, waterfall } from "../../../apps/gateway/page/decide/trace";
import { equal, report, test } from "./check";

// --- Text ----------------------------------------------------------------------------------------------------------------

test("numbers have as many digits as are worth reading", () => {
    equal([12345, -3, 1.23456, 27.81234, 0.00012, 1e16, NaN].map(numberText), ["12\u202f345", "−3", "1.235", "27.81", "1.20e−4", "1.00e+16", "–"]);
    equal([0.5, 7.25, 1000, -0.1].map(tickText), ["0.5", "7.25", "1\u202f000", "−0.1"]);
    equal([0.012, 8.44, 812, 3200, 307_000, 11_520_000, 187_200_000].map(durationText), ["12 µs", "8.4 ms", "812 ms", "3.2 s", "5 min 7 s", "3 h 12 min", "2 d 4 h"]);
    equal([512, 1400, 20_000_000].map(bytesText), ["512 B", "1.4 kB", "20 MB"]);
});

test("a time is told as one, a position exactly", () => {
    equal(valueText(1795231172.91, "s"), "2026-11-21 03:19:32.910");
    equal(valueText(48.226129, "deg"), "48.226129");
    equal([valueText(true), valueText(null), valueText("a")], ["true", "null", "a"]);
});

// --- Addresses -----------------------------------------------------------------------------------------------------------

test("an address leads back to its view", () => {
    equal(placeOf(hashOf("noun", "car1", "tyre", "a/b %")), { view: "noun", parts: ["car1", "tyre", "a/b %"] });
    equal(placeOf(""), { view: "", parts: [] });
    equal(placeOf("#/node/%zz"), { view: "node", parts: ["%zz"] });
    equal(requestPath("PULL", "car1", "echo", ["a/b", "ü"]), "/pull/car1/echo/a%2Fb/%C3%BC");
    equal(nounParts("tyre/front%2Fleft"), ["tyre", "front/left"]);
});

// --- Events --------------------------------------------------------------------------------------------------------------

test("events are read whatever the parts are in which they arrive", () => {
    const text = 'retry: 250\n\n: comment\n\nid: 5f3a09c1.17\ndata: {"a":1}\r\n\r\nevent: gap\ndata: {"missed":3}\n\ndata: x\ndata: y\n\n';
    const expected = [
        { type: "message", id: "5f3a09c1.17", data: '{"a":1}' },
        { type: "gap", id: "5f3a09c1.17", data: '{"missed":3}' },
        { type: "message", id: "5f3a09c1.17", data: "x\ny" },
    ];
    for (let size = 1; size < text.length; ++size) {
        const reader = new EventReader();
        const found = [];
        for (let at = 0; at < text.length; at += size) {
            found.push(...reader.take(text.slice(at, at + size)));
        }
        equal(found, expected, `in parts of ${size}:`);
        equal(reader.retryMs, 250);
    }
    equal(markOf("5f3a09c1.17"), { epoch: "5f3a09c1", seq: 17 });
    equal(markOf("17"), null);
});

test("a line without an end is given up", () => {
    let failed = false;
    try {
        new EventReader().take("data: " + "x".repeat(5_000_000));
    } catch {
        failed = true;
    }
    equal(failed, true);
});

test("many publishers are thinned more, and one as it was asked for", () => {
    equal([thinned(50, 1), thinned(0, 1), thinned(0, 3), thinned(50, 100), thinned(5000, 2), thinned(50, 1e6)], [50, 0, 50, 1667, 5000, 10_000]);
});

// --- The fleet -----------------------------------------------------------------------------------------------------------

const identity = (node: string, epoch = "1", more: object = {}): Json => ({ node, epoch, version: "1.0.0", tasks: [], ...more });
const answers = (nodes: Record<string, Json>, more: { errors?: Json; peers?: Json; metrics?: Json } = {}): Answers => ({
    identities: { results: nodes, errors: more.errors ?? {} }, peers: { results: more.peers ?? {} }, metrics: { results: more.metrics ?? {} }, failure: "",
});
const kinds = (fleet: Fleet): string[] => fleet.notes.map((note) => `${note.node} ${note.kind}`);

test("a node that does not answer is suspect, then lost, then back", () => {
    let fleet = fleetAfter(emptyFleet(0), answers({ car1: identity("car1"), car2: identity("car2") }), 0);
    equal(kinds(fleet), [], "those that were there first are not news:");
    const missed = answers({ car1: identity("car1") }, { errors: { car2: { error: "deadline" } } });
    fleet = fleetAfter(fleet, missed, 1000);
    equal([fleet.nodes.car2.state, problems(fleet, 1000)], ["suspect", [{ kind: "lost", node: "car2", text: "does not answer" }]]);
    fleet = fleetAfter(fleet, missed, 7000);
    equal([fleet.nodes.car2.state, kinds(fleet)], ["lost", ["car2 lost"]]);
    fleet = fleetAfter(fleet, missed, 8000);
    equal(kinds(fleet), ["car2 lost"], "it is told once:");
    fleet = fleetAfter(fleet, answers({ car1: identity("car1"), car2: identity("car2", "2") }), 9000);
    equal([fleet.nodes.car2.state, kinds(fleet)], ["live", ["car2 lost", "car2 back", "car2 restart"]]);
});

test("one that vanishes after others missed it is lost, one that just goes has left", () => {
    const both = answers({ car1: identity("car1"), car2: identity("car2") });
    const missed = answers({ car1: identity("car1") }, { peers: { car1: { peers: [{ node: "car2", state: "suspect" }] } } });
    const gone = answers({ car1: identity("car1") });
    const begun = fleetAfter(emptyFleet(0), both, 0);
    equal(fleetAfter(fleetAfter(begun, missed, 1000), gone, 2000).nodes.car2.state, "lost");
    const left = fleetAfter(begun, gone, 1000);
    equal([left.nodes.car2.state, kinds(left), problems(left, 1000)], ["left", ["car2 left"], []]);
    equal(Object.keys(forgotten(left, "car2").nodes), ["car1"]);
});

test("one that may not be asked is there", () => {
    const fleet = fleetAfter(emptyFleet(0), answers({}, { errors: { car1: { error: "denied", message: "no right" } } }), 0);
    equal([fleet.nodes.car1.state, fleet.nodes.car1.why], ["live", "no right"]);
});

test("a clash, and counters of trouble, are told", () => {
    const metrics = (shed: number, refused: number): Json => ({ car1: { updates_shed: shed, links_refused: refused, requests: { PULL: 1 } } });
    const peers = { car2: { peers: [{ node: "car1", state: "live" }, { node: "car1", state: "clash" }] } };
    let fleet = fleetAfter(emptyFleet(0), answers({ car1: identity("car1") }, { metrics: metrics(5, 0) }), 0);
    equal(problems(fleet, 0), [], "what was before is not news:");
    fleet = fleetAfter(fleet, answers({ car1: identity("car1") }, { metrics: metrics(7, 1), peers }), 1000);
    equal(problems(fleet, 1000).map((each) => `${each.kind}: ${each.text}`),
        ["clash: two nodes have this name", "refused: links refused at the limit: 1", "drop: updates dropped for slow subscribers: 2"]);
    fleet = fleetAfter(fleet, answers({ car1: identity("car1", "2") }, { metrics: metrics(0, 0) }), 2000);
    fleet = fleetAfter(fleet, answers({ car1: identity("car1", "2") }, { metrics: metrics(0, 0) }), 3000);
    equal(problems(fleet, 90_000), [], "a minute later, and after a restart:");
});

test("a counter that rises all the time leaves room for the rest", () => {
    let fleet = fleetAfter(emptyFleet(0), answers({ car1: identity("car1"), car2: identity("car2") }, { metrics: { car1: { links_refused: 0 } } }), 0);
    for (let second = 1; second <= 7200; ++second) {
        const nodes: Record<string, Json> = second === 5 ? { car1: identity("car1") } : { car1: identity("car1"), car2: identity("car2") };
        fleet = fleetAfter(fleet, answers(nodes, { metrics: { car1: { links_refused: 3 * second } } }), second * 1000);
    }
    equal(kinds(fleet).filter((note) => note.startsWith("car2")), ["car2 left", "car2 back"]);
    equal([fleet.notes.length <= 200, fleet.notes[fleet.notes.length - 1].by > 60], [true, true]);
});

test("nodes may tell anything of themselves", () => {
    const odd = { "__proto__x": { node: 7, tasks: "none", load: [], endpoints: [1, null] }, car1: "text", car2: { tasks: [{ task: 3 }, null, { verb: "PULL", task: "a" }] } };
    const fleet = fleetAfter(emptyFleet(0), answers(odd as Record<string, Json>, { peers: { car2: { peers: [null, 3] } }, metrics: { car2: { a: { b: "c", d: 1 } } } }), 0);
    equal(fleet.nodes.car2.tasks.map((task) => task.task), ["a"]);
    const named = fleetAfter(emptyFleet(0), { ...answers({}), identities: JSON.parse('{"results":{"__proto__":{"node":"__proto__"}}}') as Json }, 0);
    equal(Object.keys(named.nodes), ["__proto__"]);
});

test("a node of another pool has its pool's name before it", () => {
    const fleet = fleetAfter(emptyFleet(0), answers({ "north.car1": identity("car1"), "a.b": identity("a.b", "1", { pool: "south" }) }), 0);
    equal([fleet.nodes["north.car1"].pool, fleet.nodes["a.b"].pool], ["north", "south"]);
    equal(withResult({ errors: { gateway: { error: "no_task" } } }, "gateway", { node: "gateway" }), { results: { gateway: { node: "gateway" } }, errors: {} });
});

test("a failed round changes nothing but says so", () => {
    const fleet = fleetAfter(emptyFleet(0), answers({ car1: identity("car1") }), 0);
    const failed = fleetAfter(fleet, { ...answers({}), failure: "the gateway does not answer" }, 9000);
    equal([failed.failure, failed.nodes.car1.state], ["the gateway does not answer", "live"]);
});

// --- Metrics -------------------------------------------------------------------------------------------------------------

test("rates are those between samples, and begin anew with the counters", () => {
    const at = (ms: number, pull: number): ReturnType<typeof sampleOf> => sampleOf(flatNumbers({ requests: { PULL: pull, PUSH: 0 }, errors: 0 }), ms);
    const rows = plotRows([at(0, 0), at(2000, 10), at(3000, 3), at(4000, 5)], plotted[0]);
    equal(rows, [[2000, 5, 0, null], [3000, null, 0, null], [4000, 2, 0, null]]);
    equal(risenTroubles(flatNumbers({ memory: { refused: 1 } }), flatNumbers({ memory: { refused: 3 } })).map((each) => each.by), [2]);
    equal(taskTimes({ tasks_us: { plan: { DELEGATE: { samples: 12, p50: 20480, p99: 31743 } } } }), [{ task: "plan", verb: "DELEGATE", samples: 12, p50: 20480, p99: 31743 }]);
});

// --- Forms ---------------------------------------------------------------------------------------------------------------

const schema: Json = {
    $ref: "#/$defs/target",
    $defs: {
        target: {
            type: "object", required: ["speed", "mode", "id", "name"],
            properties: {
                speed: { type: ["number", "null"], unit: "m/s", minimum: 0, maximum: 60, description: "wanted" },
                mode: { enum: ["follow", "lead"] }, id: { type: "integer", minimum: -9223372036854775808, maximum: 9223372036854775807 },
                name: { type: "string" }, by: { type: "string", format: "date-time" }, urgent: { type: "boolean" },
                where: { $ref: "#/$defs/place" }, next: { anyOf: [{ $ref: "#/$defs/place" }, { type: "null" }] },
                gears: { type: "array", items: { type: "number", unit: "rpm" } }, way: { anyOf: [{ type: "string" }, { type: "number" }] },
            },
        },
        place: { type: "object", required: ["lat"], properties: { lat: { type: "number", unit: "deg", default: 48 }, below: { $ref: "#/$defs/place" } } },
    },
};

test("a form has the members of the type", () => {
    const form = fieldOf(schema);
    equal(form.fields.map((field) => `${field.label} ${field.kind} ${field.unit}${field.isRequired ? " *" : ""}`), [
        "speed number m/s *", "mode choice  *", "id integer  *", "name text  *", "by time ", "urgent boolean ", "where object ", "next object ", "gears json ", "way json "]);
    equal([form.fields[0].maximum, form.fields[0].isNullable, form.fields[2].maximum], [60, true, undefined]);
});

const written = (inputs: Inputs): [string | undefined, string[]] => {
    const problems: Problem[] = [];
    const text = bodyOf(fieldOf(schema), inputs, problems);
    return [text, problems.map((each) => `${each.path} ${each.text}`)];
};

test("a body is made of the form, with what it begins with", () => {
    equal(written({}), ['{"speed":0,"mode":"follow","id":0,"name":"","where":{"lat":48,"below":{"lat":48,"below":{"lat":48,"below":{"lat":48,"below":{"lat":48}}}}},"next":{"lat":48,"below":{"lat":48,"below":{"lat":48,"below":{"lat":48,"below":{"lat":48}}}}}}', []]);
});

test("integers of 64 bits, and texts, stay as they were written", () => {
    const [text] = written({ id: "9007199254740993", name: ' "x" ', speed: "", by: "2026-01-01T00:00:00Z", gears: "[1, 2]", urgent: "true" });
    equal(text?.startsWith('{"speed":null,"mode":"follow","id":9007199254740993,"name":" \\"x\\" ","by":"2026-01-01T00:00:00Z","urgent":true,'), true, text);
    equal(text?.endsWith('"gears":[1, 2]}'), true, text);
});

test("what is wrong is named", () => {
    equal(written({ speed: "61", id: "1.5", gears: "[1" })[1], ["speed is at most 60", "id is a whole number", "gears is not valid JSON"]);
    equal(written({ speed: "fast", id: "" })[1], ["speed is a number", "id is missing"]);
});

test("a schema that leads in a circle, or is none, has an end", () => {
    equal(fieldOf({ $ref: "#" }).kind, "json");
    equal(fieldOf(null).kind, "json");
    equal(exampleOf({ type: "object", required: ["a"], properties: { a: { $ref: "#" } } }) !== undefined, true);
    const wide = { type: "object", properties: Object.fromEntries(Array.from({ length: 500 }, (_, i) => [`m${i}`, { type: "object", properties: { a: { type: "number" } } }])) };
    equal(fieldOf(wide).fields.filter((field) => field.kind === "json").length > 300, true);
});

test("units are found by the path of a number", () => {
    const meanings = meaningsOf(schema);
    equal([meaningAt(meanings, "speed"), meaningAt(meanings, "gears.3").unit, meaningAt(meanings, "where.lat").unit, meaningAt(meanings, "x").unit], [{ unit: "m/s", description: "wanted" }, "rpm", "deg", ""]);
    equal(meaningAt(meaningsOf({ type: "object", additionalProperties: { unit: "K" } }), "front").unit, "K");
    equal(parameterNames({ prefixItems: [{ title: "ms", unit: "ms" }] }, []), [{ name: "ms", description: "ms" }]);
});

// --- Updates -------------------------------------------------------------------------------------------------------------

const update = (seq: number, value: Json, epoch = "0000000a"): { type: string; id: string; data: string } => ({ type: "message", id: `${epoch}.${seq}`, data: JSON.stringify(value) });

test("updates become rows, and gaps end their lines", () => {
    const series = new Series(false);
    series.take(update(1, { v: 1, name: "a" }), 1000);
    series.take(update(5, { v: 2, w: [3] }), 1100);
    series.take({ type: "gap", id: "", data: '{"missed":3}' }, 1150);
    series.take({ type: "restart", id: "", data: '{"epoch":"0000000b"}' }, 1160);
    series.take(update(1, { v: 4 }, "0000000b"), 1200);
    equal(series.names, ["v", "w.0"]);
    equal(series.rows.map((row) => row.map((value) => (Number.isNaN(value) ? "gap" : value))), [[1000, 1, null], [1100, 2, 3], [1150, "gap", "gap"], [1160, "gap", "gap"], [1200, 4, null]]);
    equal(series.marks.map((mark) => mark.kind), ["gap", "restart"]);
    equal([series.received, series.published, series.missed], [3, 6, 3]);
});

test("a publisher that goes and comes back", () => {
    const series = new Series(false);
    series.take({ type: "lost", id: "", data: '{"reason":"it is gone"}' }, 1);
    equal([series.isLost, series.marks[0].text], [true, "it is gone"]);
    series.take({ type: "rebound", id: "", data: "{}" }, 2);
    equal(series.isLost, false);
    series.take({ type: "failure", id: "", data: '{"error":"denied","message":"no right"}' }, 3);
    equal(series.failure, "no right");
    series.take({ type: "message", id: "", data: "no JSON" }, 4);
    equal(series.received, 0);
});

test("a stream that is interrupted leaves a gap, and is told once", () => {
    const series = new Series(false);
    series.interrupt(0, "not yet");
    series.take(update(1, { v: 1 }), 1000);
    series.interrupt(1100, "the gateway does not answer");
    series.interrupt(1200, "the gateway does not answer");
    series.take(update(9, { v: 2 }), 2000);
    series.interrupt(2100, "the gateway does not answer");
    equal(series.marks.map((mark) => mark.at), [1100, 2100]);
    equal(series.rows.map((row) => Number.isNaN(row[1])), [false, true, false, true]);
});

test("of all, each publisher has lines of its own", () => {
    const series = new Series(true);
    series.take({ type: "message", id: "", data: '{"node":"car1","update":{"lat":48,"lon":11,"v":1}}' }, 1000);
    series.take({ type: "message", id: "", data: '{"node":"car2","update":{"lat":48.001,"lon":11,"v":2}}' }, 1010);
    equal(series.names, ["car1 lat", "car1 lon", "car1 v", "car2 lat", "car2 lon", "car2 v"]);
    equal(plotGroups(series.names, (name) => (name.endsWith("v") ? "m/s" : ""), (name) => !name.endsWith("v")), [{ unit: "m/s", columns: [2, 5] }]);
    const { lines, half } = projected(series.tracks);
    equal(lines.map((line) => line.points.map(([x, y]) => [Math.round(x), Math.round(y)])), [[[0, -56]], [[0, 56]]]);
    equal([Math.round(half), scaleLength(70), scaleLength(2300)], [61, 50, 2000]);
});

test("a stream that lasts takes no more and more memory", () => {
    const series = new Series(false, 60_000);
    for (let i = 0; i < 50_000; ++i) {
        series.take(update(i + 1, { v: i, lat: 1, lon: i / 1e6 }), i * 20);
        if (i % 10 === 0) {
            series.take({ type: "gap", id: "", data: '{"missed":1}' }, i * 20);
        }
    }
    equal([series.rows.length <= 6000, series.marks.length <= 100, series.tracks[""].points.length <= 4000, Math.round(series.rates(50_000 * 20).arrive)], [true, true, true, 50]);
});

test("updates that come faster than they can be shown take each other's place, and are counted", () => {
    const series = new Series(false, 60_000);
    for (let i = 0; i < 100_000; ++i) {
        series.take(update(2 * i + 1, { v: i }), 1_000_000 + Math.floor(i / 10));
    }
    equal([series.rows.length, series.rows[0][0], series.rows[999][1]], [1000, 1_000_000, 99_999]);
    const { arrive, published } = series.rates(1_010_000);
    equal([Math.round(arrive / 100), Math.round(published / 100)], [100, 200]);
});

test("a position is found where it is, and only if it is one", () => {
    equal(positionIn({ a: { latitude: 1, longitude: 2 } }), { lat: 1, lon: 2 });
    equal([positionIn({ lat: 91, lon: 2 }), positionIn({ lat: "1", lon: 2 }), positionIn(null)], [null, null, null]);
});

// --- Traces --------------------------------------------------------------------------------------------------------------

test("what was received is in the middle of what was sent", () => {
    const bars = waterfall(spansIn({
        gateway: { spans: [{ span: "b", parent: "a", kind: "sent", verb: "PULL", target: "car1", task: "echo", start_us: 0, total_us: 100, outcome: "ok" }] },
        car1: {
            spans: [
                { span: "c", parent: "b", kind: "received", verb: "PULL", target: "car1", task: "echo", start_us: 0, queue_us: 5, run_us: 20, total_us: 60, outcome: "ok" },
                { span: "d", parent: "c", kind: "sent", verb: "PULL", target: "any", task: "x", start_us: 10, total_us: 30, outcome: "deadline" },
            ],
        },
    }));
    equal(bars.map((bar) => [bar.node, bar.depth, bar.startUs, bar.totalUs]), [["gateway", 0, 0, 100], ["car1", 1, 20, 60], ["car1", 2, 30, 30]]);
    equal(endOf(bars), 100);
});

test("spans that claim to be their own parents have an end", () => {
    const circle = { spans: [{ span: "a", parent: "b", kind: "sent" }, { span: "b", parent: "a", kind: "received" }, { span: "c", parent: "c", kind: "sent" }] };
    equal(waterfall(spansIn({ car1: circle })).length, 3);
    equal(waterfall(spansIn({ car1: 3, car2: { spans: [null] } })).length, 1);
});

test("a trace begins with digits that others accept", () => {
    const { id, stated } = newTrace(new Uint8Array(24));
    equal([isTraceId(id), /^00-[0-9a-f]{32}-(?!0{16})[0-9a-f]{16}-01$/.test(stated), isTraceId("0".repeat(32)), isTraceId("x")], [true, true, false, false]);
});

// --- Rights --------------------------------------------------------------------------------------------------------------

test("rights permit what docs/protocol_security.md says", () => {
    const cases: [string, string, string, string, boolean][] = [
        ["pull,bind *:localization", "bind", "car1", "localization", true], ["pull,bind *:localization", "push", "car1", "localization", false],
        ["* car2:*/**", "push", "car2", "a/b/c", true], ["* car2:*/**", "push", "car1", "a", false], ["delegate sat1:plan/**", "delegate", "sat1", "plan", true],
        ["pull *:cles", "pull", "car1", "cles/metrics", false], ["pull *:cles/trace/*", "pull", "car1", "cles/trace/1", true],
        ["pull *:a*c", "pull", "car1", "abc", true], ["pull *:a*c", "pull", "car1", "ab", false], ["pull *:**", "pull", "car1", "a", false],
        ["pull any:a", "pull", "any", "a", false], ["pull *:%2A", "pull", "car1", "*", true], ["pull *:%2A", "pull", "car1", "a", false], ["pull *:a.c", "pull", "x", "abc", false],
        ["PULL *:a", "pull", "x", "a", false],
    ];
    for (const [right, verb, node, noun, expected] of cases) {
        equal(permits(right, verb, node, nounParts(noun)), expected, `${right}, of ${verb} ${node}:${noun}:`);
    }
});

test("who may do something, and why", () => {
    const roster = rosterIn({ signature: "", roster: { version: 3, members: [{ number: 1, name: "car1", offers: ["pull *:a"] }, { number: 2, name: "door", may: [], forwards: ["*"] }, { number: 3, name: "op", may: ["pull *:*"] }] } });
    const said = (member: number, verb: string, node: string, noun: string): unknown => roster && verdict(roster, roster.members[member], verb, node, nounParts(noun)).may;
    equal([said(0, "PULL", "car1", "a"), said(1, "PULL", "car1", "a"), said(2, "PULL", "car1", "a"), said(2, "PULL", "car1", "b"), said(2, "PUSH", "door", "b"), said(0, "PUSH", "door", "b"), said(0, "PUSH", "car9", "b")],
        [true, false, true, false, false, true, false]);
    equal(rosterIn({ error: "no_task" }), null);
});

// --- The map -------------------------------------------------------------------------------------------------------------

test("no two nodes of the map are in one place", () => {
    for (const count of [1, 2, 5, 24, 25, 200]) {
        const names = Array.from({ length: count }, (_, i) => `n${i}`);
        const layout = layoutOf([{ pool: "", nodes: names }, { pool: "b", nodes: ["x"] }], 1200);
        const spots = Object.values(layout.spots);
        equal(spots.length, count + 1);
        const isApart = spots.every((a, i) => spots.slice(i + 1).every((b) => Math.hypot(a.x - b.x, a.y - b.y) > 50));
        const isInside = spots.every((spot) => spot.x > 0 && spot.y > 0 && spot.x < layout.width && spot.y < layout.height);
        equal([count, isApart, isInside], [count, true, true]);
    }
});

report();
