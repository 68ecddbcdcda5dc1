#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks how much code the public headers add to the compilation of their users.

    header_cost_test.py --compiler CXX --headers DIR --define NAME... --scratch DIR

`registrar.hpp` and the headers for plugins include no Asio. `service.hpp` has few lines beyond those of the standard
library and of Asio that its interface needs, as the preprocessor counts them on this machine. Of a request or a feed that
a coroutine awaits, a program compiles only what depends on the type of the result: how it is read. A service on an
`io_context` does not have its users compile Asio's executors, nor how the map of its peers is copied and destroyed.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

# What the types in the interface of `service.hpp` need: containers and functions, executors, and coroutines.
NEEDED = ("any", "functional", "map", "memory", "optional", "span", "string", "string_view", "unordered_map",
          "variant", "vector", "boost/asio/any_io_executor.hpp", "boost/asio/use_awaitable.hpp")
MOST_BEYOND = 0.049  # of the lines that these have

AWAITING = """
#include <cles/service.hpp>

struct reading { int value = 0; };
BOOST_DESCRIBE_STRUCT(reading, (), (value))

boost::asio::awaitable<int> ask(cles::service& node) {
    const auto pulled = co_await node.async_pull<reading>("car0:speed");
    const auto pushed = co_await node.async_push<reading>("car0:speed", pulled, cles::call_options{});
    co_return pushed.value;
}

boost::asio::awaitable<int> follow(cles::service& node) {
    co_await node.async_update("speed", reading{});
    auto feed = co_await node.async_bind<reading>("car0:speed");
    const auto item = co_await feed.async_next();
    co_await node.async_close(std::chrono::milliseconds{1});
    co_return item.value.value;
}
"""

CALLING = """
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

void ask(boost::asio::io_context& io) {
    cles::service node{io, {.name = "me", .peers = {{"car0", "tcp://127.0.0.1"}}}};
    node.async_pull<int>("car0:speed", [](boost::system::error_code, int) {});
}
"""

COPYING = """
#include <map>
#include <string>

std::map<std::string, std::string> copy(const std::map<std::string, std::string>& other) { return other; }
"""


def map_functions(names: list[str]) -> list[str]:
    return [name for name in names if "_Rb_tree" in name and re.search("_M_(copy|erase|insert)", name)]


class Compiler:
    def __init__(self, options: argparse.Namespace):
        self.command = [options.compiler, "-std=c++20", f"-I{options.headers.resolve()}",
                        *(f"-D{name}" for name in options.define)]
        self.source = options.scratch / "includes.cpp"

    def run(self, headers: tuple[str, ...], *flags: str) -> str:
        return self.run_on("".join(f"#include <{header}>\n" for header in headers), *flags)

    def run_on(self, text: str, *flags: str) -> str:
        self.source.write_text(text, encoding="utf-8")
        return subprocess.run([*self.command, *flags, str(self.source)], check=True, capture_output=True, text=True).stdout

    def asio_in(self, header: str) -> list[str]:
        """The files of Asio that a header includes."""
        return [name for name in self.run((header,), "-M").split() if "/boost/asio" in name]

    def lines_of(self, *headers: str) -> int:
        """Lines of code after preprocessing: without empty ones and those that name the file."""
        lines = self.run(headers, "-E").splitlines()
        return sum(1 for line in lines if line.strip() and not line.startswith("#"))

    def functions_of(self, text: str) -> list[str]:
        """The mangled names of the functions that are compiled for this source."""
        return re.findall(r"^(_Z\w+):", self.run_on(text, "-O0", "-S", "-o", "-"), re.MULTILINE)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--compiler", required=True)
    parser.add_argument("--headers", required=True, type=Path)
    parser.add_argument("--define", action="append", default=[])
    parser.add_argument("--scratch", required=True, type=Path)
    options = parser.parse_args()
    options.scratch.mkdir(parents=True, exist_ok=True)
    compiler = Compiler(options)

    failures = []
    if not compiler.asio_in("cles/service.hpp"):
        failures.append("no Asio found in service.hpp, which includes it: this test does not recognise it")
    light = ["registrar.hpp", *sorted(path.name for path in (options.headers / "cles").glob("plugin*.hpp"))]
    for header in light:
        if asio := compiler.asio_in(f"cles/{header}"):
            failures.append(f"{header} includes {len(asio)} files of Asio, first {asio[0]}")

    needed, all_lines = compiler.lines_of(*NEEDED), compiler.lines_of("cles/service.hpp", *NEEDED)
    beyond = all_lines / needed - 1
    if beyond > MOST_BEYOND:
        failures.append(f"service.hpp has {all_lines} lines, {beyond:.1%} more than the {needed} that it needs; at most "
                        f"{MOST_BEYOND:.1%} more")

    functions = compiler.functions_of(AWAITING)
    if not any("read_result" in name for name in functions):
        failures.append("a program that awaits requests reads no result: this test does not recognise it")
    operations = [name for name in functions
                  if ("7reading" in name or "13error_code" in name) and
                  any(part in name for part in ("_operation", "10completion", "_call", "13awaited_event"))]
    if operations:
        failures.append(f"{len(operations)} functions of operations are compiled for what a coroutine awaits, first "
                        f"{operations[0]}")

    functions = compiler.functions_of(CALLING)
    if not any("reply_operation" in name for name in functions):
        failures.append("a program with a callback has no operation: this test does not recognise it")
    executors = [name for name in functions if "any_executor" in name and "basic_executor_type" in name]
    if executors:
        failures.append(f"{len(executors)} functions of Asio's executors are compiled for a service on an io_context, first "
                        f"{executors[0]}")

    if not map_functions(compiler.functions_of(COPYING)):
        failures.append("a program that copies a std::map has no function of it: this test does not recognise it")
    if maps := map_functions(functions):
        failures.append(f"{len(maps)} functions of std::map are compiled for the peers of a service, first {maps[0]}")

    print("\n".join([*failures, f"{len(light)} headers without Asio; service.hpp: {all_lines} lines, {needed} of them of the "
                                f"standard library and of Asio"]))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
