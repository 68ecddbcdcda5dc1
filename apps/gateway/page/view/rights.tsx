// SPDX-License-Identifier: BSL-1.0
// Who may do what: the roster of the fleet, and questions to it.
import { Component, h } from "preact";
import { sortedNodes } from "../decide/fleet";
import { nounParts } from "../decide/route";
import { Roster, rosterIn, verdict } from "../decide/rights";
import { ask, failureText } from "../io";
import { Empty, Table, ViewProps } from "./parts";

interface RightsState {
    roster: Roster | null;
    wrong: string;
    verb: string;
    noun: string;
}

const list = (rights: string[] | null): JSX.Element => rights === null ? <b>everything</b> : rights.length === 0 ? <span>nothing</span>
    : <span>{rights.map((right) => <code class="right">{right}</code>)}</span>;

export class RightsView extends Component<ViewProps, RightsState> {
    state: RightsState = { roster: null, wrong: "", verb: "PUSH", noun: "" };

    async componentDidMount(): Promise<void> {
        if (this.props.session.secured) {
            const reply = await ask("GET", "/pull/self/cles/roster", { deadlineMs: 3000 });
            const roster = reply.status === 200 ? rosterIn(reply.value) : null;
            this.setState({ roster, wrong: roster ? "" : `The gateway does not tell its roster: ${failureText(reply)}` });
        }
    }

    private question(roster: Roster) {
        const { verb, noun } = this.state;
        const [, node = "", path = ""] = /^([^:]+):(.+)$/.exec(noun.trim()) ?? [];
        const parts = nounParts(path);
        const rows = parts.length === 0 ? [] : roster.members.map((member) => {
            const said = verdict(roster, member, verb, node, parts);
            return [member.name, said.may ? <b class="yes">✓ may</b> : <b class="no">✕ may not</b>, <code>{said.why}</code>];
        });
        return (
            <section>
                <h2>Who may…</h2>
                <div class="controls">
                    <select aria-label="verb" onChange={(event) => this.setState({ verb: (event.target as HTMLSelectElement).value })}>
                        {["PULL", "PUSH", "DELEGATE", "BIND", "UPDATE"].map((each) => <option selected={each === verb}>{each}</option>)}
                    </select>
                    <input aria-label="noun" class="id" placeholder="car1:target" value={noun} onInput={(event) => this.setState({ noun: (event.target as HTMLInputElement).value })} />
                </div>
                {rows.length > 0 ? <Table label="Who may" heads={["member", "", "why"]} rows={rows} /> : <Empty text="Write a node, ':' and a task." />}
                <p class="key">By the roster. The rules of a node can only narrow it (docs/security.md).</p>
            </section>
        );
    }

    render({ session, fleet }: ViewProps) {
        const { roster, wrong } = this.state;
        const special = sortedNodes(fleet).flatMap((node) => node.tasks.filter((task) => task.isSigned || task.isLocal).map((task) =>
            [node.name, `${task.verb} ${task.task}`, task.isSigned ? "the signature of its requester, so not through this gateway" : "", task.isLocal ? "its jobs do not move" : ""]));
        return (
            <div>
                <h1>Who may do what</h1>
                <p>{session.name !== "" ? <span>You are <b>{session.name}</b>. </span> : null}
                    {session.secured ? "The fleet has keys: each request has the rights of the member whose token you have, and the gateway needs the right to forward for it."
                        : session.name !== "" ? "The fleet has no keys: a token admits to this gateway, and what it is used for has the rights of anybody."
                            : "The fleet has no keys, and this gateway no tokens: whoever can run programs on this host may ask everything."}</p>
                {wrong !== "" ? <p class="warning" role="alert">{wrong}</p> : null}
                {roster ? this.question(roster) : null}
                {roster ? <h2>Members <small>roster {roster.version}</small></h2> : null}
                {roster ? <Table label="Members" heads={["#", "member", "may request", "offers to others", "forwards for"]} rows={roster.members.map((member) => [
                    member.number, member.name, list(member.may), list(member.offers), member.forwards.join(", ") || "nobody",
                ])} /> : null}
                <h2>Tasks with conditions</h2>
                {special.length === 0 ? <Empty text="No task states any." /> : <Table label="Tasks with conditions" heads={["node", "task", "needs", "moves"]} rows={special} />}
            </div>
        );
    }
}
