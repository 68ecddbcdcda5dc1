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

HEADER = """#include <cles/feed_batch.hpp>
#include <cles/service.hpp>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/deferred.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/describe.hpp>
#include <array>
#include <chrono>
#include <memory>
#include <set>
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
struct plan { std::string name{}; std::set<int> ids{}; };
BOOST_DESCRIBE_STRUCT(plan, (), (name, ids))
struct painted { std::vector<std::optional<colour>> in{}; };
BOOST_DESCRIBE_STRUCT(painted, (), (in))
struct tagged { char tag[4] = {}; };
BOOST_DESCRIBE_STRUCT(tagged, (), (tag))
struct fixed { const int id = 0; };
BOOST_DESCRIBE_STRUCT(fixed, (), (id))
class secret { std::set<int> ids{}; BOOST_DESCRIBE_CLASS(secret, (), (), (), (ids)) };
"""

TEMPORARY = "g++ 12 destroys a temporary aggregate twice where the call is awaited: name it first"
SHAPE = "a handler takes (), (const cles::request&), (body), (const cles::request&, body) or"
NOT_WRITTEN = "the handler's result cannot be written as JSON: describe a struct with BOOST_DESCRIBE_STRUCT"
NO_DEFAULT = "the type of an answer or an update needs a default constructor: it is made first, and then read"
CALLBACK = "a callback takes a boost::system::error_code and then the result"
CALLBACK_ALONE = "a callback takes a boost::system::error_code alone here"
NO_TOKEN = "a duration is not a completion token: a deadline is an option"
LIST = "the option is a list: put braces around the text"
NAMES = "CLES_NAMES takes members that BOOST_DESCRIBE_STRUCT names"
TOO_MANY = "BOOST_DESCRIBE_STRUCT and BOOST_DESCRIBE_ENUM take at most 52 names"
NO_BODY = "PULL and BIND have no body: their handler takes their parameters"
NOT_READ = "the handler's argument cannot be read from JSON: describe a struct with BOOST_DESCRIBE_STRUCT"


def handler(text: str, verb: str = "push") -> str:
    return f'void f(cles::service& car) {{ car.on_{verb}("task", {text}); }}'


def coroutine(text: str) -> str:
    return f"asio::awaitable<void> f(cles::service& node) {{ {text} }}"


def callback(text: str) -> str:
    return f"void f(cles::service& node) {{ {text} }}"


def service(text: str) -> str:
    return f"void f(asio::io_context& io) {{ cles::service node{{io, {{.name = \"car\", {text}}}}}; }}"


def named(text: str) -> str:
    return f"struct pose {{ int klass = 0; int b = 0; }}; BOOST_DESCRIBE_STRUCT(pose, (), (klass, b)) CLES_NAMES(pose, {text})" + (
        "std::string f() { return cles::to_json(pose{}); }"
    )


def many(count: int) -> str:
    return ", ".join(f"m{i}" for i in range(count))


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
    "pull_with_body": (handler("[](position) { return 1; }", "pull"), NO_BODY),
    "bind_with_body": (handler("[](const cles::request&, const note&) {}", "bind"), NO_BODY),
    "bind_coroutine": (
        handler("[](cles::request) -> asio::awaitable<void> { co_return; }", "bind"),
        "a BIND handler must be a plain function",
    ),
    "bind_with_responder": (
        handler("[](const cles::request&, const cles::responder& r) { r.done(); }", "bind"),
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
    "unwritable_member": (handler("[] { return plan{}; }", "pull"), ("as_JSON", "plan::ids", "std::set<int>")),
    "unreadable_member": (handler("[](const plan&) {}"), ("from_JSON", "plan::ids", "std::set<int>")),
    "unwritable_in_member": (handler("[] { return painted{}; }", "pull"), ("as_JSON", "painted::in", "colour")),
    "unreadable_array": (handler("[](const tagged&) {}"), ("from_JSON", "tagged::tag", "char [4]")),
    "constant_member": (handler("[](const fixed&) {}"), ("from_JSON", "fixed::id", "const int")),
    "unwritable_private_member": (
        callback('node.update("ids", secret{});'),
        ("as_JSON", "secret::ids", "std::set<int>"),
    ),
    "answer_without_value": (coroutine('co_await node.async_pull<void>("a:b");'), "an answer is a value"),
    "answer_without_value_to_callback": (
        callback('node.async_pull<void>("a:b", [](boost::system::error_code) {});'),
        "an answer is a value",
    ),
    "answer_without_default": (coroutine('co_await node.async_pull<no_default>("a:b");'), NO_DEFAULT),
    "update_without_default": (coroutine('co_await node.async_bind<no_default>("a:b");'), NO_DEFAULT),
    "body_without_default": (
        handler('[](const cles::request& r) { r.as<no_default>(); }'),
        "the type of a body needs a default constructor",
    ),
    "elements_without_default": (
        handler("[](const std::vector<no_default>&) {}"),
        "what a container, an optional or a variant holds needs a default constructor",
    ),
    "callback_without_value": (
        callback('node.async_pull<double>("a:b", [](boost::system::error_code) {});'),
        CALLBACK,
    ),
    "callback_without_code": (callback('node.async_pull<double>("a:b", [](double) {});'), CALLBACK),
    "bound_callback_without_value": (
        callback(
            'node.async_push<double>("a:b", 1, asio::bind_executor(node.get_executor(), [](boost::system::error_code) {}));'
        ),
        CALLBACK,
    ),
    "callback_without_feed": (callback('node.async_bind<double>("a:b", [](boost::system::error_code) {});'), CALLBACK),
    "callback_with_value": (
        callback('node.async_update("noun", 1, [](boost::system::error_code, int) {});'),
        CALLBACK_ALONE,
    ),
    "callback_of_feed": (
        'void f(cles::feed<double>& feed) { feed.async_next([](boost::system::error_code) {}); }',
        CALLBACK,
    ),
    "callback_of_batches": (
        'void f(cles::feed<double>& feed) { feed.async_next_batch([](boost::system::error_code) {}); }',
        CALLBACK,
    ),
    "deadline_as_token": (
        coroutine('co_await node.async_pull<double>("a:b", std::chrono::milliseconds{200});'),
        NO_TOKEN,
    ),
    "deadline_as_token_of_push": (
        coroutine('co_await node.async_push("a:b", 1, std::chrono::seconds{1});'),
        NO_TOKEN,
    ),
    "deadline_as_token_of_bind": (coroutine('co_await node.async_bind("a:b", std::chrono::seconds{1});'), NO_TOKEN),
    "listen_is_a_text": (service('.listen = "tcp://127.0.0.1:0"'), LIST),
    "networks_are_a_text": (service('.networks = std::string{"10.0.0.0/8"}'), LIST),
    "seeds_are_a_text": (service('.gossip = cles::gossip("tcp://127.0.0.1")'), LIST),
    "parameters_are_a_text": (
        callback('node.on_pull("a", [] { return 1; }, {.parameters = "which"});'),
        LIST,
    ),
    "name_of_no_member": (named('(c, "class")'), NAMES),
    "name_without_quotes": (named("(klass, class)"), NAMES),
    "name_is_missing": (named('(klass), (b, "class")'), NAMES),
    "name_with_escapes": (named('(klass, "cl\\"ass")'), NAMES),
    "name_of_another_member": (named('(klass, "b")'), "CLES_NAMES gives two members the same name"),
    "name_of_no_enumerator": (
        "enum class mode { a, b }; BOOST_DESCRIBE_ENUM(mode, a, b) CLES_NAMES(mode, (c, \"default\"))"
        "std::string f() { return cles::to_json(mode::a); }",
        "CLES_NAMES takes enumerators that BOOST_DESCRIBE_ENUM names",
    ),
    "too_many_members": (
        f"struct wide {{ int {many(53)}; }}; BOOST_DESCRIBE_STRUCT(wide, (), ({many(53)}))"
        "std::string f() { return cles::to_json(wide{}); }",
        TOO_MANY,
    ),
    "far_too_many_private_members": (
        f"class wide {{ int {many(100)}; BOOST_DESCRIBE_CLASS(wide, (), (), (), ({many(100)})) }};"
        + handler("[](const wide&) {}"),
        TOO_MANY,
    ),
    "too_many_enumerators": (
        f"enum class wide {{ {many(53)} }}; BOOST_DESCRIBE_ENUM(wide, {many(53)})"
        "std::string f() { return cles::to_json(wide::m1); }",
        TOO_MANY,
    ),
    "default_of_no_member": (
        "struct old { int a = 0; int b = 0; }; BOOST_DESCRIBE_STRUCT(old, (), (a, b)) CLES_DEFAULTS(old, (c))\n"
        'int f() { return cles::from_json<old>("{}").a; }',
        "CLES_DEFAULTS names a member that BOOST_DESCRIBE_STRUCT does not",
    ),
    "range_of_a_text": (
        "struct old { std::string a; }; BOOST_DESCRIBE_STRUCT(old, (), (a)) CLES_FIELD(old, a, \"\", \"\", 0, 1)\n"
        'bool f(old& o) { return cles::from_json("{}", o); }',
        "CLES_FIELD gives a range to a member that is not a number",
    ),
    "range_from_high_to_low": (
        "struct old { int a = 0; }; BOOST_DESCRIBE_STRUCT(old, (), (a)) CLES_FIELD(old, a, \"\", \"\", 1, 0)\n"
        'bool f(old& o) { return cles::from_json("{}", o); }',
        "CLES_FIELD takes the minimum, then the maximum",
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
            car.on_push("a", free_function);
            car.on_push("b", &free_function);
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
            car.on_pull("p", [] { return tagged{}; });
            car.on_push("q", [](char axis) { return axis; });
            car.on_pull("r", [](std::vector<std::string> parameters) { return parameters; });
            car.on_bind("s", [](const cles::request&, const std::vector<std::string>&) {});
            car.on_pull("t", [only = std::make_unique<int>(1)](std::vector<std::string>) -> asio::awaitable<int> { co_return *only; });
        }
    """,
    "most_members": f"struct wide {{ int {many(52)}; }}; BOOST_DESCRIBE_STRUCT(wide, (), ({many(52)}))"
    f"enum class many {{ {many(52)} }}; BOOST_DESCRIBE_ENUM(many, {many(52)})"
    "std::string f() { return cles::to_json(wide{}) + cles::to_json(many::m51); }",
    "tokens": """
        asio::awaitable<void> f(cles::service& node, cles::feed<double>& feed) {
            node.async_pull<double>("a:b", [](auto...) {});
            node.async_pull<double>("a:b", [](boost::system::error_code, const double&) {});
            node.async_pull<int>("a:b", cles::call_options{}, [](boost::system::error_code, double) {});
            node.async_bind<std::string>("a:b", [](boost::system::error_code, cles::feed<std::string>) {});
            node.async_update("a", 1, [](const boost::system::error_code&) {});
            node.async_close(std::chrono::seconds{1}, [](boost::system::error_code) {});
            feed.async_next([only = std::make_unique<int>(1)](boost::system::error_code, cles::feed_item<double>) mutable {});
            co_await node.async_close(std::chrono::seconds{1});
            co_await node.async_pull<double>("a:b", asio::as_tuple(asio::use_awaitable));
        }
    """,
    "lists": """
        void f(asio::io_context& io, const char* text, std::string url, std::vector<std::string> urls) {
            cles::service one{io, {.name = "a", .listen = {"tcp://127.0.0.1:0"}, .networks = {"10.0.0.0/8", "fd00::/8"}}};
            cles::service two{io, {.name = "b", .listen = {text}, .networks = urls}};
            cles::service three{io, {.name = "c", .listen = {url, "tcp://127.0.0.1:0"}, .gossip = cles::gossip({url})}};
            cles::service four{io, {.name = "d", .listen = std::move(urls), .gossip = cles::gossip({"a", "b"}, {text})}};
            cles::service five{io, {.name = "e", .listen = {}, .gossip = cles::gossip()}};
            cles::service_options options{.name = "f"};
            options.listen.push_back(url);
            options.listen = {text, "b"};
            std::vector<std::string> copy = options.listen;
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


def judge(arguments, name: str, program: str, expected: str | tuple[str, ...]) -> str:
    errors = compile_one(arguments, name, program, "c++17" if name == "older_standard" else "c++20")
    if not errors:
        return "it compiled"
    if any(part not in errors[0] for part in ((expected,) if isinstance(expected, str) else expected)):
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
