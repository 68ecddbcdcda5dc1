// SPDX-License-Identifier: BSL-1.0
// Runs cases in any engine of JavaScript, without its libraries.

declare const console: { log(text: string): void };

let cases = 0;
const failures: string[] = [];

export function test(name: string, body: () => void): void {
    ++cases;
    try {
        body();
    } catch (error) {
        failures.push(`${name}: ${error instanceof Error ? error.message : String(error)}`);
    }
}

export function equal(found: unknown, expected: unknown, what = ""): void {
    const [a, b] = [found, expected].map((value) => JSON.stringify(value, (_key, each) => (each === undefined ? "undefined" : each)));
    if (a !== b) {
        throw new Error(`${what} found ${a}, expected ${b}`);
    }
}

export function report(): void {
    failures.forEach((failure) => console.log(failure));
    console.log(`${cases} cases, ${failures.length} failed`);
    if (failures.length > 0) {
        throw new Error("cases have failed");
    }
}
