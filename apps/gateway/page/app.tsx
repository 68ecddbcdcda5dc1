// SPDX-License-Identifier: BSL-1.0
// The page: who is signed in, what is wrong anywhere, and the view that its address names.
import { Component, h, render } from "preact";
import "dygraphs/dygraph.css";
import "./style.css";
import { emptyFleet, Fleet, fleetAfter, forgotten, problems, roundMs, sortedNodes, withResult } from "./decide/fleet";
import { Json, objectOf, textOf } from "./decide/format";
import { hashOf, Place, placeOf } from "./decide/route";
import { ask, failureText, onSessionEnd, poll } from "./io";
import { ConsoleView } from "./view/console";
import { FleetView } from "./view/fleet";
import { NodeView } from "./view/node";
import { NounView } from "./view/noun";
import { NodeLink, Session, ViewProps } from "./view/parts";
import { RightsView } from "./view/rights";
import { TraceView } from "./view/trace";

const views: { key: string; view: string; name: string }[] = [
    { key: "1", view: "", name: "Fleet" },
    { key: "2", view: "console", name: "Console" },
    { key: "3", view: "trace", name: "Trace" },
    { key: "4", view: "rights", name: "Rights" },
];
const problemSigns: Record<string, string> = { lost: "✕", clash: "!", refused: "⊘", drop: "▼" };

interface AppState {
    session: Session | null;
    needsToken: boolean;
    wrong: string;
    fleet: Fleet;
    place: Place;
    now: number;
    theme: string;
    isHelpOpen: boolean;
}

function storedTheme(): string {
    try {
        return localStorage.getItem("theme") ?? "";
    } catch {
        return "";
    }
}

class Login extends Component<{ wrong: string; signIn: (token: string) => void }, { token: string }> {
    state = { token: "" };

    render({ wrong, signIn }: { wrong: string; signIn: (token: string) => void }) {
        return (
            <form class="login" onSubmit={(event) => { event.preventDefault(); signIn(this.state.token.trim()); this.setState({ token: "" }); }}>
                <h1>Sign in</h1>
                <p>This gateway wants a token. <code>cles gateway --new-token NAME --tokens FILE</code> makes one.</p>
                <label for="token">token</label>
                <input id="token" type="password" autocomplete="off" autofocus value={this.state.token} onInput={(event) => this.setState({ token: (event.target as HTMLInputElement).value })} />
                <button class="main" type="submit">sign in</button>
                {wrong !== "" ? <p class="problem" role="alert">{wrong}</p> : null}
                <p class="key">The page exchanges it for a cookie that scripts cannot read, for 12 hours, and forgets it.</p>
            </form>
        );
    }
}

class App extends Component<Record<string, never>, AppState> {
    state: AppState = {
        session: null, needsToken: false, wrong: "", fleet: emptyFleet(Date.now()), place: placeOf(location.hash), now: Date.now(),
        theme: storedTheme() || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"), isHelpOpen: false,
    };

    componentDidMount(): void {
        window.addEventListener("hashchange", () => {
            this.setState({ place: placeOf(location.hash) });
            window.scrollTo(0, 0);
        });
        document.addEventListener("keydown", this.onKey);
        onSessionEnd(() => this.setState({ needsToken: true, session: null }));
        this.applyTheme();
        void this.learnSession();
        poll(this.round, (failure) => this.setState((state: AppState) => ({ now: Date.now(), fleet: { ...state.fleet, failure } })));
    }
    componentDidUpdate(): void {
        this.applyTheme();
    }
    private applyTheme(): void {
        document.documentElement.setAttribute("data-theme", this.state.theme);
    }

    private async learnSession(): Promise<void> {
        const reply = await ask("GET", "/session");
        const told = objectOf(reply.value);
        if (reply.status === 200) {
            this.setState({ session: { node: textOf(told.node), name: textOf(told.name), secured: told.secured === true }, needsToken: false, wrong: "" });
        } else if (reply.status !== 401) {
            this.setState({ wrong: failureText(reply) });
        }
    }
    private signIn = async (token: string): Promise<void> => {
        if (!/^[\x21-\x7e]+$/.test(token)) { // others are not allowed in a field of HTTP
            this.setState({ wrong: "A token has no such characters." });
            return;
        }
        const reply = await ask("POST", "/session", { headers: { Authorization: `Bearer ${token}` } });
        if (reply.status >= 200 && reply.status < 300) {
            await this.learnSession();
        } else {
            this.setState({ wrong: failureText(reply) });
        }
    };
    private signOut = async (): Promise<void> => {
        await ask("DELETE", "/session");
        this.setState({ session: null, needsToken: true, wrong: "", fleet: emptyFleet(Date.now()) });
    };

    /** One round of questions to all nodes. */
    private round = async (): Promise<number> => {
        if (this.state.session === null) {
            if (!this.state.needsToken) {
                await this.learnSession();
            }
            return 500;
        }
        const gateway = this.state.session.node;
        const all = async (task: string): Promise<{ value: Json; failure: string }> => { // the gateway is no part of its 'all'
            const [others, own] = await Promise.all(["all", "self"].map((node) => ask("GET", `/pull/${node}/${task}`, { deadlineMs: 2000 })));
            const isGood = others.status === 200 || textOf(objectOf(others.value).error) === "no_target"; // nobody else is there
            return { value: withResult(others.value, gateway, own.status === 200 ? own.value : null), failure: isGood ? "" : failureText(others) };
        };
        const identities = await all("cles");
        const [peers, metrics] = [await all("cles/peers"), await all("cles/metrics")];
        const now = Date.now();
        this.setState((state: AppState) => ({
            now, fleet: fleetAfter(state.fleet, { identities: identities.value, peers: peers.value, metrics: metrics.value, failure: identities.failure }, now),
        }));
        return roundMs(Object.keys(this.state.fleet.nodes).length);
    };

    private onKey = (event: KeyboardEvent): void => {
        const isTyping = /^(INPUT|TEXTAREA|SELECT)$/.test((event.target as Element).tagName);
        if (event.ctrlKey || event.altKey || event.metaKey || (isTyping && event.key !== "Escape")) {
            return;
        }
        const view = views.find((each) => each.key === event.key);
        if (view) {
            location.hash = hashOf(view.view);
        } else if (event.key === "/") {
            event.preventDefault();
            document.getElementById("search")?.focus();
        } else if (event.key === "t") {
            this.toggleTheme();
        } else if (event.key === "?" || (event.key === "Escape" && this.state.isHelpOpen)) {
            this.setState({ isHelpOpen: !this.state.isHelpOpen });
        }
    };
    private toggleTheme = (): void => {
        const theme = this.state.theme === "dark" ? "light" : "dark";
        this.setState({ theme });
        try {
            localStorage.setItem("theme", theme);
        } catch { // the choice is not kept
        }
    };

    private search = (event: Event): void => {
        event.preventDefault();
        const input = document.getElementById("search") as HTMLInputElement;
        const text = input.value.trim();
        const [, node, noun] = /^([^:]+):(.+)$/.exec(text) ?? [];
        const found = sortedNodes(this.state.fleet).find((each) => each.name === text) ?? sortedNodes(this.state.fleet).find((each) => each.name.includes(text));
        if (node !== undefined) {
            location.hash = hashOf("noun", node, ...noun.split("/"));
        } else if (found && text !== "") {
            location.hash = hashOf("node", found.name);
        }
        input.value = "";
        input.blur();
    };

    private problems() {
        const found = problems(this.state.fleet, this.state.now);
        const failure = this.state.fleet.failure;
        return (
            <div role="status" aria-label="What is wrong now"><ul class="problems">
                {failure !== "" ? <li class="chip lost"><span aria-hidden="true">✕</span> {failure}</li> : null}
                {found.slice(0, 8).map((each) => (
                    <li class={`chip ${each.kind}`}><span aria-hidden="true">{problemSigns[each.kind]}</span> <NodeLink name={each.node} /> {each.text}</li>
                ))}
                {found.length > 8 ? <li class="chip">and {found.length - 8} more</li> : null}
                {found.length === 0 && failure === "" ? <li class="chip good"><span aria-hidden="true">✓</span> no losses, clashes, refusals or drops in the last minute</li> : null}
            </ul></div>
        );
    }

    private view(session: Session) {
        const { fleet, place, now, theme } = this.state;
        const props: ViewProps & { key: string } = { fleet, session, parts: place.parts, now, theme, key: `${place.view} ${place.parts.join("/")}` };
        switch (place.view) {
            case "node": return <NodeView {...props} />;
            case "noun": return <NounView {...props} />;
            case "console": return <ConsoleView {...props} key="console" />;
            case "trace": return <TraceView {...props} key="trace" />;
            case "rights": return <RightsView {...props} />;
            default: return <FleetView {...props} forget={(name: string) => this.setState((state: AppState) => ({ fleet: forgotten(state.fleet, name) }))} />;
        }
    }

    render() {
        const { session, needsToken, wrong, place, fleet, theme, isHelpOpen } = this.state;
        return (
            <div class="page">
                <a class="skip" href="#content" onClick={(event) => { event.preventDefault(); document.getElementById("content")?.focus(); }}>to the content</a>
                <header>
                    <a class="logo" href="#/"><svg width="22" height="22" viewBox="0 0 32 32" aria-hidden="true"><path d="M8 9l16 3M8 9l7 15M24 12l-9 12" /><circle cx="8" cy="9" r="4" /><circle cx="24" cy="12" r="4" /><circle cx="15" cy="24" r="4" /></svg> CLES</a>
                    <nav aria-label="Views">{views.map((each) => (
                        <a href={hashOf(each.view)} class={each.view === place.view ? "current" : ""} aria-current={each.view === place.view ? "page" : undefined}>{each.name}</a>
                    ))}</nav>
                    <form role="search" onSubmit={this.search}>
                        <input id="search" list="names" aria-label="Find a node, or NODE:NOUN" placeholder="find ( / )" />
                        <datalist id="names">{sortedNodes(fleet).slice(0, 200).map((node) => <option value={node.name} />)}</datalist>
                    </form>
                    <button onClick={this.toggleTheme} aria-label={theme === "dark" ? "Light colours" : "Dark colours"}>{theme === "dark" ? "☀" : "☾"}</button>
                    <button onClick={() => this.setState({ isHelpOpen: !isHelpOpen })} aria-label="Keys" aria-expanded={isHelpOpen}>?</button>
                    {session && session.name !== "" ? <button onClick={() => void this.signOut()}>sign out {session.name}</button> : null}
                </header>
                {isHelpOpen ? <p class="help"><b>1</b>–<b>4</b> views, <b>/</b> find a node or NODE:NOUN, <b>t</b> dark or light, <b>Ctrl+Enter</b> sends in the console, <b>Escape</b> cancels, <b>?</b> closes this.</p> : null}
                {session ? this.problems() : null}
                <main id="content" tabIndex={-1}>
                    {session ? this.view(session) : needsToken ? <Login wrong={wrong} signIn={(token) => void this.signIn(token)} /> : <p class="empty">{wrong || "…"}</p>}
                </main>
                <footer>{session ? `gateway ${session.node} · ` : ""}<a href="/openapi.json">OpenAPI</a> · <a href="/metrics">metrics</a> · <a href="/licences.txt">licences of what this page contains</a></footer>
            </div>
        );
    }
}

const root = document.getElementById("app");
if (root) {
    root.textContent = "";
    render(<App />, root);
}
