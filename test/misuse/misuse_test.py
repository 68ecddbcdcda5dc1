#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Compiles programs that use the library wrongly, and checks that the compiler reports it in one readable line.

    misuse_test.py --compiler CXX --include DIR... --define NAME... --scratch DIR

Of each program the first error must be the library's own, and the only one. Programs that look alike and are right must
compile. All that include nothing share one precompiled header.
"""

import argparse
import concurrent.futures
import re
import subprocess
import sys
from pathlib import Path

HEADER = """#include <cles/service.hpp>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/deferred.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/describe.hpp>
#include <array>
#include <memory>
namespace asio = boost::asio;
struct note { std::string text{}; };
BOOST_DESCRIBE_STRUCT(note, (), (text))
struct position { double lat = 0; double lon = 0; };
BOOST_DESCRIBE_STRUCT(position, (), (lat, lon))
struct named { named(std::string t = {}) : text(std::move(t)) {} std::string text; };
BOOST_DESCRIBE_STRUCT(named, (), (text))
struct undescribed { int x = 0; };
struct no_default { no_default(int n) : x(n) {} int x; };
BOOST_DESCRIBE_STRUCT(no_default, (), (x))
enum class colour { red, green };
"""

TEMPORARY = "g++ 12 destroys a temporary aggregate twice where the call is awaited: name it first"
SHAPE = "a handler takes (), (const cles::request&), (body), (const cles::request&, body) or"
NOT_WRITTEN = "the handler's result cannot be written as JSON: describe a struct with BOOST_DESCRIBE_STRUCT"
NOT_READ = "the handler's argument cannot be read from JSON: describe a struct with BOOST_DESCRIBE_STRUCT"


def handler(text: str, verb: str = "push") -> str:
    return f'void f(cles::service& car) {{ car.on_{verb}("task", {text}); }}'


def coroutine(text: str) -> str:
    return f"asio::awaitable<void> f(cles::service& node) {{ {text} }}"


# name: (the program, the text of the first error)
WRONG = {
    # Handlers.
    "auto_parameter": (handler("[](auto body) { return body; }"), "the handler's arguments are not known"),
    "auto_request": (handler("[](const auto& request, position) {}"), "the handler's arguments are not known"),
    "overloaded_call": (
        "struct both { void operator()(int) {} void operator()(double) {} };" + handler("both{}"),
        "the handler's arguments are not known",
    ),
    "not_callable": (handler("42"), "the handler is not callable"),
    "not_callable_object": (handler("position{}", "pull"), "the handler is not callable"),
    "member_function": (
        "struct car_type { void steer(position); };" + handler("&car_type::steer"),
        "a member function cannot be a handler without its object",
    ),
    "three_arguments": (handler("[](const cles::request&, position, int) {}"), SHAPE),
    "request_second": (handler("[](position, const cles::request&) {}"), SHAPE),
    "responder_alone": (handler("[](cles::responder) {}"), SHAPE),
    "mutable_body": (handler("[](position& to) { to.lat = 1; }"), "a handler takes its arguments by value or by"),
    "mutable_request": (handler("[](cles::request&) {}"), "a handler takes its arguments by value or by"),
    "undescribed_argument": (handler("[](undescribed) {}"), NOT_READ),
    "undescribed_result": (handler("[] { return undescribed{}; }", "pull"), NOT_WRITTEN),
    "undescribed_enum": (handler("[] { return colour::red; }", "pull"), NOT_WRITTEN),
    "undescribed_in_vector": (
        handler("[] { return std::vector<undescribed>{}; }", "pull"),
        "this type cannot be written as JSON: describe a struct with BOOST_DESCRIBE_STRUCT",
    ),
    "view_argument": (handler("[](std::string_view) {}"), NOT_READ),
    "no_default_constructor": (handler("[](no_default) {}"), "the type of a handler's body needs a default constructor"),
    "coroutine_by_reference": (
        handler("[](const note&) -> asio::awaitable<void> { co_return; }"),
        "a coroutine takes its body by value",
    ),
    "coroutine_on_other_executor": (
        handler("[]() -> asio::awaitable<void, asio::io_context::executor_type> { co_return; }"),
        "a handler's coroutine is a boost::asio::awaitable of the default executor",
    ),
    "coroutine_result_beside_responder": (
        handler("[](const cles::request&, cles::responder) -> asio::awaitable<int> { co_return 1; }"),
        "a coroutine with a responder answers through it",
    ),
    "bind_coroutine": (
        handler("[](cles::request) -> asio::awaitable<void> { co_return; }", "bind"),
        "a BIND handler must be a plain function",
    ),
    # Calls.
    "wide_integer": (
        "__extension__ typedef __int128 wide; std::string f(wide number) { return cles::to_json(number); }",
        "this type cannot be written as JSON",
    ),
    "undescribed_body": (
        coroutine('const undescribed body{}; co_await node.async_push("a:b", body);'),
        "this type cannot be written as JSON",
    ),
    "undescribed_answer": (
        coroutine('co_await node.async_pull<undescribed>("a:b");'),
        "this type cannot be read from JSON",
    ),
    "undescribed_update": (
        'void f(cles::service& car) { car.update("noun", undescribed{}); }',
        "this type cannot be written as JSON",
    ),
    "undescribed_feed": (
        coroutine('auto feed = co_await node.async_bind<undescribed>("a:b"); co_await feed.async_next();'),
        "this type cannot be read from JSON",
    ),
    "coroutine_header_missing": (
        "#include <cles/registrar.hpp>\n#include <boost/asio/awaitable.hpp>\n"
        'void f(cles::registrar& to) { to.on_pull("x", []() -> boost::asio::awaitable<int> { co_return 1; }); }',
        "a handler that is a coroutine needs #include <cles/coroutine_handler.hpp>",
    ),
    "default_of_no_member": (
        "struct old { int a = 0; int b = 0; }; BOOST_DESCRIBE_STRUCT(old, (), (a, b)) CLES_DEFAULTS(old, (c))\n"
        'int f() { return cles::from_json<old>("{}").a; }',
        "CLES_DEFAULTS names a member that BOOST_DESCRIBE_STRUCT does not",
    ),
}

# The same, only for g++ 12.
WRONG_HERE = {
    "temporary_push": (coroutine('co_await node.async_push("w:note", note{.text = "long"});'), TEMPORARY),
    "temporary_delegate": (
        coroutine('co_await node.async_delegate<double>("w:go", note{"x"}, cles::call_options{}.urgent());'),
        TEMPORARY,
    ),
    "temporary_update": (coroutine('co_await node.async_update("note", note{"x"});'), TEMPORARY),
    "temporary_as_tuple": (
        coroutine('co_await node.async_push("w:note", note{"x"}, asio::as_tuple(asio::use_awaitable));'),
        TEMPORARY,
    ),
    "temporary_bound": (
        coroutine(
            'co_await node.async_push("w:note", note{"x"}, '
            "asio::bind_executor(node.get_executor(), asio::use_awaitable));"
        ),
        TEMPORARY,
    ),
    "temporary_deferred": (coroutine('co_await node.async_push("w:note", note{"x"}, asio::deferred);'), TEMPORARY),
    "temporary_array": (
        coroutine('co_await node.async_push("w:notes", std::array<std::string, 2>{"a", "b"});'),
        TEMPORARY,
    ),
}

# Correct programs that are similar to wrong ones.
RIGHT = {
    "bodies": coroutine(
        """
        const note text{.text = "long"};
        co_await node.async_push("w:note", text);
        co_await node.async_push("w:note", text, cles::call_options{}.urgent());
        co_await node.async_push("w:note", "text");
        co_await node.async_push("w:note", std::string{"text"});
        co_await node.async_push("w:note", 0.8);
        co_await node.async_push("w:note", position{1, 2});
        co_await node.async_push("w:note", named{"x"});
        co_await node.async_push("w:note", cles::json_text{"{}"});
        co_await node.async_delegate<double>("w:note", std::vector<int>(2));
        co_await node.async_update("note", 1);
        node.async_push("w:note", note{"x"}, asio::detached);
        node.async_push("w:note", note{"x"}, [](boost::system::error_code, cles::json_text) {});
        node.update("note", note{"x"});
        """
    ),
    "coroutine_header": (
        "#include <cles/coroutine_handler.hpp>\n"
        'void f(cles::registrar& to) { to.on_pull("x", []() -> boost::asio::awaitable<int> { co_return 1; }); }'
    ),
    "handlers": """
        int free_function(position) { return 1; }
        struct counter { int operator()(const cles::request&) const { return 1; } };
        void f(cles::service& car) {
            car.on_pull("a", free_function);
            car.on_pull("b", &free_function);
            car.on_pull("c", counter{});
            car.on_pull("d", std::function<double()>{[] { return 1.5; }});
            car.on_pull("e", [n = 0]() mutable { return ++n; });
            car.on_pull("f", [only = std::make_unique<int>(1)] { return *only; });
            car.on_push("g", [only = std::make_unique<int>(1)](const cles::request&, cles::responder r) { r.done(*only); });
            car.on_push("h", [only = std::make_unique<int>(1)](note) -> asio::awaitable<int> { co_return *only; });
            car.on_push("i", [](cles::request, cles::responder r) -> asio::awaitable<void> { r.done(); co_return; });
            car.on_push("j", [](const cles::request&, const cles::responder& r) { r.done(); });
            car.on_push("k", [](const note&) { return "literal"; });
            car.on_push("l", [](note&&) {});
            car.on_bind("m", [](const cles::request&) {});
            car.on_push("n", [](std::optional<std::variant<int, note>> x) { return x; });
            car.on_push("o", [](std::chrono::milliseconds x) { return std::chrono::system_clock::time_point{x}; });
        }
    """,
}

LONGEST = 400  # characters of a readable line


def compile_one(arguments, name: str, program: str, standard: str = "c++20") -> list[str]:
    source = arguments.scratch / f"{name}.cpp"
    if not program.startswith("#include"):
        program = ('#include "misuse.hpp"\n' if standard == "c++20" else "#include <cles/service.hpp>\n") + program
    source.write_text(program + "\n", encoding="utf-8")
    done = subprocess.run(
        [*arguments.command, f"-std={standard}", "-fsyntax-only", str(source)],
        capture_output=True,
        text=True,
        timeout=120,
        env={"LC_ALL": "C", "PATH": "/usr/bin:/bin"},
        cwd=arguments.scratch,
    )
    errors = [line for line in done.stderr.splitlines() if re.search(r"\berror: ", line)]
    if done.returncode != 0 and not errors:
        errors = [done.stderr or "the compiler failed without a word"]
    return errors


def judge(arguments, name: str, program: str, expected: str) -> str:
    errors = compile_one(arguments, name, program, "c++17" if name == "older_standard" else "c++20")
    if not errors:
        return "it compiled"
    if expected not in errors[0]:
        return f"the first error is not ours: {errors[0][:LONGEST]}"
    if len(errors[0]) > LONGEST:
        return f"the first error has {len(errors[0])} characters"
    others = [e for e in errors[1:] if "nothing more is compiled" not in e]
    if others:
        return f"{len(others)} more errors follow, first: {others[0][:LONGEST]}"
    return ""


def judge_right(arguments, name: str, program: str) -> str:
    errors = compile_one(arguments, name, program)
    return f"it does not compile: {errors[0][:LONGEST]}" if errors else ""


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--compiler", required=True)
    parser.add_argument("--include", action="append", default=[])
    parser.add_argument("--define", action="append", default=[])
    parser.add_argument("--scratch", required=True, type=Path)
    arguments = parser.parse_args()
    arguments.scratch = arguments.scratch.resolve()
    arguments.scratch.mkdir(parents=True, exist_ok=True)
    arguments.command = [arguments.compiler, "-O0"]
    arguments.command += [f"-I{Path(d).resolve()}" for d in arguments.include] + [f"-D{d}" for d in arguments.define]

    header = arguments.scratch / "misuse.hpp"
    header.write_text(HEADER, encoding="utf-8")
    version = subprocess.run([arguments.compiler, "--version"], capture_output=True, text=True, check=True).stdout
    is_gcc = "clang" not in version.lower()
    if is_gcc:
        subprocess.run([*arguments.command, "-std=c++20", "-x", "c++-header", str(header)], check=True, timeout=120)
    macros = subprocess.run([arguments.compiler, "-dM", "-E", "-x", "c++", "/dev/null"], capture_output=True, text=True, check=True)
    major = int(re.search(r"__GNUC__ (\d+)", macros.stdout).group(1))

    wrong = dict(WRONG)
    wrong["older_standard"] = ("", "CLES needs C++20")
    if is_gcc and major < 13:
        wrong |= WRONG_HERE

    with concurrent.futures.ThreadPoolExecutor(max_workers=2) as two:
        verdicts = {name: two.submit(judge, arguments, name, *case) for name, case in wrong.items()}
        verdicts |= {name: two.submit(judge_right, arguments, name, text) for name, text in RIGHT.items()}
    failures = 0
    for name, verdict in verdicts.items():
        if verdict.result():
            failures += 1
            print(f"{name}: {verdict.result()}")
    print(f"{len(wrong)} wrong programs and {len(RIGHT)} right ones, {failures} mistakes")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
