#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks which folders may include which others, and a few other rules that no compiler checks.

    include_rules.py [ROOT]        checks the tree; prints each violation; exits 1 where there is one
    include_rules.py --self-test   plants violations in a scratch tree and expects to find every one of them

The tables below list the layers and what each may include: a new folder under libcles/src needs a line in LAYERS.
"""

from __future__ import annotations

import posixpath
import re
import statistics
import sys
import tempfile
from pathlib import Path

SOURCE_SUFFIXES = {".cpp", ".hpp", ".h", ".ipp"}

# Which layer a file belongs to: that of the longest matching prefix. "src" are the files directly in libcles/src, which
# implement public headers.
LAYERS = {
    "libcles/include/cles/": "public",
    "libcles/src/json/": "json",
    "libcles/src/protocol/": "protocol",
    "libcles/src/port/": "port",
    "libcles/src/node/": "node",
    "libcles/src/federation/": "federation",
    "libcles/src/nats/": "nats",
    "libcles/src/security/": "security",
    "libcles/src/tls/": "tls",
    "libcles/src/transport/": "transport",
    "libcles/src/asio/": "asio",
    "libcles/src/api/": "api",
    "libcles/src/": "src",
    "apps/shared/": "programs",
    "runtime/": "runtime",
    "plugins/": "plugins",
    "apps/": "apps",
    "perf/": "perf",
    "test/": "test",
}
LIBRARY = {"public", "json", "protocol", "port", "node", "federation", "nats", "security", "tls", "transport", "asio", "api", "src"}

# layer -> the layers whose files it may include besides its own. "plain" are the public headers that include nothing of
# NOT_SANS_IO, directly or indirectly; "below_facade" are all public headers except FACADE_HEADERS.
MAY_INCLUDE = {
    "public": set(),
    "json": {"plain"},
    "protocol": {"json", "plain"},
    "port": {"protocol", "plain", "link"},
    "node": {"json", "protocol", "port", "below_facade"},
    "federation": {"json", "protocol", "port", "plain"},
    "nats": {"public", "protocol", "port", "node", "federation"},
    "security": {"json", "protocol", "port", "plain"},
    "tls": {"protocol", "security", "transport", "plain", "link"},
    "transport": {"json", "protocol", "port", "plain", "link"},
    "asio": {"public", "protocol", "port", "node", "transport"},
    "api": {"public", "json", "protocol", "port", "node", "transport", "asio", "federation", "nats", "security", "tls"},
    "src": {"public"},
    "programs": {"public"},
    "runtime": {"public", "programs"},
    "plugins": {"public"},
    "apps": {"public", "programs"},
    "perf": {"public"},
    "test": LIBRARY | {"programs", "runtime", "plugins"},
}

# The public headers that a transport may include although they are not plain.
LINK_HEADERS = {"cles/link.hpp"}
# The top of the public API: in the library, only the layers that may include all of "public" may include these.
FACADE_HEADERS = {f"cles/{name}.hpp" for name in ("service", "feed", "plugin", "run")}

# file -> layers that it may include beyond those of its own layer, each with a reason:
#     "perf/grammar_speed.cpp": {"protocol"},  # measures the parser without a link
EXCEPTIONS: dict[str, set[str]] = {
    "test/plugins/three_homes_test.cpp": {"apps"},  # the tasks of an example, in service, test and plugin
    "test/effort/impaired_line_test.cpp": {"perf"},  # the decisions of the measurements' impaired link
    "perf/routing/choice_cost.cpp": {"node", "protocol"},  # measures a choice without a link
    "perf/tls/roster_spread.cpp": {"security", "test"},  # makes a fleet of its own, in a folder as tests have
    "perf/tls/tls_cost.cpp": {"security", "tls"},  # the same
    "perf/tls/tls_links.cpp": {"security", "test", "tls"},  # the same
    "perf/jobs/isolation_cost.cpp": {"runtime"},  # its daemon runs it as the process of a plugin
    "perf/jobs/job_daemon.cpp": {"runtime"},  # a daemon that is measured, in a process of its own
    "perf/jobs/job_daemon.hpp": {"runtime"},  # the same
}

# Headers for I/O, waiting or threads: forbidden in sans-I/O layers, where time is a parameter.
NOT_SANS_IO = re.compile(
    r"""boost/(asio|beast|dll|process|thread|interprocess)(\.hpp$|/)
      | (thread|mutex|shared_mutex|condition_variable|future|semaphore|latch|barrier|stop_token)$
      | (iostream|fstream|filesystem|csignal|print)$
      | (sys|net|netinet|arpa|linux)/
      | (unistd|poll|fcntl|netdb|signal|pthread|ifaddrs)\.h$
    """,
    re.VERBOSE,
)
SANS_IO = {"json", "protocol", "port", "node", "federation", "security"}
# file -> such headers that it may include and use nevertheless, each with a reason.
WITHOUT_IO = {
    "libcles/src/port/ip_network.cpp": {"arpa/inet.h"},  # inet_pton and inet_ntop read and write text
    "libcles/src/security/datagrams/fork_count.cpp": {"pthread.h"},  # pthread_atfork: keys must not be used on in a child process
    "libcles/src/security/core_dumps.cpp": {"sys/prctl.h", "sys/resource.h"},  # limits of the process
    # Files of keys and plugins; each is checked after it has been opened.
    "libcles/src/security/fleet/checked_file.cpp": {"fcntl.h", "sys/stat.h", "sys/xattr.h", "unistd.h"},
    "libcles/src/security/fleet/file_protection.cpp": {"sys/stat.h", "unistd.h"},
    "libcles/src/security/fleet/protected_folder.cpp": {"fcntl.h", "sys/file.h", "sys/stat.h", "unistd.h"},
    "libcles/src/security/keys/secret.cpp": {"mutex"},  # any thread may destroy a secret
}

# What sans-I/O code must not use, because it is passed the time and its random numbers.
NOT_SANS_IO_WORDS = [
    (re.compile(r"\b\w*_?clock\s*::\s*now\b"), "reads a clock: take the time as a parameter"),
    (re.compile(r"\b(clock_gettime|gettimeofday|timespec_get)\b"), "reads a clock: take the time as a parameter"),
    (re.compile(r"\bstd::time\s*\("), "reads a clock: take the time as a parameter"),
    (re.compile(r"\brandom_device\b|\bstd::s?rand\s*\(|(?<![\w:.>])s?rand\s*\("), "draws from global chance: take a generator"),
    (re.compile(r"\b(static|thread_local|inline)\s+(thread_local\s+)?(std::)?(mt19937\w*|minstd_rand\w*|default_random_engine)\b"),
     "keeps a global generator: take one"),
    (re.compile(r"\bthis_thread\b|\bstd::(j?thread|async|mutex)\b"), "waits, locks or starts threads"),
    (re.compile(r"\b(std::)?getenv\s*\("), "reads the environment: take an option"),
]

# (pattern of the header, where it may stand, what to say)
RESERVED_HEADERS = [
    (re.compile(r"yaml-cpp/"), re.compile(r"runtime/src/config/"), "yaml-cpp belongs to runtime/config alone"),
    (re.compile(r"boost/dll(\.hpp$|/)"), re.compile(r"runtime/src/plugins/plugin_library\.[ch]pp$"),
     "Boost.DLL belongs to runtime/plugins/plugin_library alone"),
    (re.compile(r"sodium(\.h$|/)"), re.compile(r"libcles/src/security/|test/security/|test/simulation/secured/"), "libsodium belongs to security alone"),
    (re.compile(r"openssl/"), re.compile(r"libcles/src/tls/|libcles/src/nats/tls_watch\.cpp$|apps/gateway/access/tokens\.cpp$|test/tls/"
                                         r"|test/perf/sealed_pull\.cpp$"),
     "OpenSSL belongs to tls alone"),
    # Others have inline functions of C, which some version of Debian 12 may write in a way that C++ does not read.
    (re.compile(r"linux/(?!(audit|capability|filter|if_tun|sched|seccomp)\.h$)"), re.compile(r"(?!)"),
     "of the kernel's headers, only the listed ones are sure to be valid C++: define the constants that you need"),
    (re.compile(r"turbojpeg\.h$"), re.compile(r"plugins/fmv/frame_codec\.cpp$"), "libjpeg-turbo belongs to fmv/frame_codec.cpp alone"),
    (re.compile(r"node/secured/"), re.compile(r"libcles/src/(node/secured|api)/|test/"),
     "programs without security do not contain it: use node/security_protocol.hpp"),
    (re.compile(r"(thread|future|boost/asio/thread_pool\.hpp)$"), re.compile(r"(?!apps/(cles|gateway|platoon)/)"),
     "but for its log, this program has one thread, so the thread sanitizer does not run its tests (test/CMakeLists.txt)"),
]

# These add seconds to the compile time of every user of the header.
HEAVY_IN_PUBLIC = re.compile(r"boost/asio\.hpp$|boost/asio/(use_future|experimental/awaitable_operators)\.hpp$|boost/json\.hpp$")

# Descriptors that programs started by this one would inherit. Asio opens and accepts sockets so.
INHERITED = [
    (re.compile(r"(?<![\w>])::(socket|accept4|open|openat|pipe2|socketpair|eventfd|timerfd_create|memfd_create|epoll_create1)\s*\((?!.*CLOEXEC)",
                re.DOTALL), "close-on-exec is missing"),
    (re.compile(r"(?<![\w>])::(dup|pipe|accept)\s*\("), "programs that are started inherit it: use a function that sets close-on-exec"),
]
INHERITING_HEADERS = re.compile(r"fstream$")
INHERITED_LAYERS = LIBRARY | {"programs", "runtime", "apps", "plugins"}
INHERITED_OF_ASIO = re.compile(r"\basync_accept\b|\bacceptor_?\.accept\(|\.open\([^;]*(protocol\(\)|::v[46]\(\))"
                               r"|(?<!make_private<udp::socket>)(?<!open_private)[({]\w+, *(\w+::)*(udp|tcp)::v[46]\(\)")

# What looks up names waits for them as long as the system does.
LOOKUP = re.compile(r"\b(async_resolve|getaddrinfo|gethostbyname)\b|::resolver\b")

# A category of errors: without an id, the one of a shared library differs from that of the program.
CATEGORY = re.compile(r"\bclass \w+[^;{}]*:\s*public (?:boost::system::)?error_category\s*\{(?P<body>.*?)^\};", re.MULTILINE | re.DOTALL)
CATEGORY_ID = re.compile(r":\s*error_category\(0x")

# In public headers, templates of functions are called by their qualified names: otherwise a function of that name in the
# namespace of the user's type may be called instead. For the same reason, nothing is taken apart by structured bindings.
FUNCTION_TEMPLATE = re.compile(r"^template <[^\n]*\n(?:[ \t}>][^\n]*\n|template <[^\n]*\n)*"
                               r"(?!struct|class|using|concept|union|extern|friend)[^\n=(]*?(?<!::)\b(?!operator|decltype|requires)(\w+)\(",
                               re.MULTILINE)
STRUCTURED_BINDING = re.compile(r"\bauto\s*&{0,2}\s*\[")

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"\n]+)[>"]', re.MULTILINE)


# --- Reading sources -----------------------------------------------------------------------------------------------------

TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | (?P<raw>\bR"(?P<tag>[^()\s\\]{0,16})\(.*?\)(?P=tag)")
      | (?P<string>"(?:\\.|[^"\\\n])*")
      | (?P<char>(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+')
    """,
    re.VERBOSE | re.DOTALL,
)


def without_comments_and_strings(text: str, keep_strings: bool = False) -> str:
    """The same text with as many lines, its comments and the contents of its strings blanked."""

    def blank(match: re.Match) -> str:
        if keep_strings and match.lastgroup != "comment":
            return match.group(0)
        lines = "\n" * match.group(0).count("\n")
        return lines if match.lastgroup == "comment" else '""' + lines

    return TOKEN.sub(blank, text)


def includes_of(text: str) -> list[tuple[int, str, str]]:
    """(line, '<' or '"', header) for each include that is not commented out."""
    clean = without_comments_and_strings(text, keep_strings=True)
    return [(clean.count("\n", 0, m.start()) + 1, m.group(1), m.group(2)) for m in INCLUDE.finditer(clean)]


def statements_of(clean: str):
    """(line, text) of each stretch between ';', '{' and '}'."""
    start, line, counted = 0, 1, 0
    for match in re.finditer(r"[;{}]|\Z", clean):
        text = clean[start : match.start()].strip()
        begins = clean.find(text, start)
        line += clean.count("\n", counted, begins)
        counted = begins
        yield line, text
        start = match.end()


OPERATOR = re.compile(r"\bco_await\b|\band\b|\bor\b|(?<=\s)(?:&&|\|\|)(?=\s)|\?|[()\[\],]|<<=|[^=!<>]=(?!=)")


def has_conditional_await(statement: str) -> bool:
    """Whether a co_await stands under ?:, && or ||, which g++ 12 compiles wrongly.

    Only operators beside the co_await, or around it, count: those in its operand or in another argument do not.
    """
    if "co_await" not in statement:
        return False
    # A group is the parts between two commas inside one pair of brackets; path: the groups around a token.
    path, next_group = [0], 1
    awaits, operators = [], []
    for match in OPERATOR.finditer(statement):
        token = match.group(0)
        if token in "([":
            path = path + [next_group]
            next_group += 1
        elif token in ")]":
            path = path[:-1] or [next_group]
            next_group += 1
        elif token == ",":
            path = path[:-1] + [next_group]
            next_group += 1
        elif token == "co_await":
            awaits.append(path)
        elif token in ("&&", "||", "?", "and", "or"):
            operators.append(path)
    return any(a[: len(o)] == o for a in awaits for o in operators)


# --- The checks ----------------------------------------------------------------------------------------------------------


class Tree:
    def __init__(self, root: Path):
        self.root = root
        self.violations: list[str] = []
        self.texts: dict[str, str] = {}
        for folder in sorted({prefix.split("/")[0] for prefix in LAYERS}):
            for path in sorted((root / folder).rglob("*")):
                if path.suffix in SOURCE_SUFFIXES and path.is_file():
                    self.texts[path.relative_to(root).as_posix()] = path.read_text(encoding="utf-8")
        self.includes = {name: includes_of(text) for name, text in self.texts.items()}
        self.reasons: dict[str, str] = {}
        names = {name for file, text in self.texts.items() if self.layer_of(file) == "public"
                 for name in FUNCTION_TEMPLATE.findall(without_comments_and_strings(text))}
        # Without arguments, or after the name of a type (a declaration), nothing is looked up.
        self.unqualified_call = re.compile(
            r"^[ \t]+(?:.*?(?:[^\w:.>~ \t]|\breturn|\bco_return|\bco_await|\belse)[ \t]*)?\b(%s)(?:<[^()\n]*>)?\((?!\))"
            % "|".join(sorted(names)), re.MULTILINE) if names else None

    def complain(self, name: str, line: int, what: str) -> None:
        self.violations.append(f"{name}:{line}: {what}")

    def layer_of(self, name: str) -> str:
        return LAYERS[max((p for p in LAYERS if name.startswith(p)), key=len)]

    def resolve(self, name: str, quote: str, header: str) -> str | None:
        """The file of this tree that an include means, or nothing where it is another project's."""
        bases = ["libcles/include", "libcles/src", "apps/shared", "runtime/include", "runtime/src", "runtime", "test"]
        if quote == '"':
            bases.insert(0, posixpath.dirname(name))
        for base in bases:
            candidate = posixpath.normpath(f"{base}/{header}")
            if candidate in self.texts:
                return candidate
        return None

    def why_not_plain(self, name: str, seen: frozenset = frozenset()) -> str:
        """How a header reaches what is not sans-I/O, as 'a.hpp -> b.hpp -> boost/asio.hpp'; empty where it does not."""
        if name in self.reasons:
            return self.reasons[name]
        short = name.removeprefix("libcles/include/")
        reason = ""
        for _, quote, header in self.includes[name]:
            if NOT_SANS_IO.match(header):
                reason = f"{short} -> {header}"
                break
            inner = self.resolve(name, quote, header)
            if inner and inner not in seen and inner != name:
                further = self.why_not_plain(inner, seen | {name})
                if further:
                    reason = f"{short} -> {further}"
                    break
        if not seen or reason:
            self.reasons[name] = reason
        return reason

    def check_include(self, name: str, line: int, quote: str, header: str) -> None:
        layer = self.layer_of(name)

        for pattern, allowed, what in RESERVED_HEADERS:
            if pattern.match(header) and not allowed.match(name):
                self.complain(name, line, f"<{header}>: {what}")
        if layer in INHERITED_LAYERS and INHERITING_HEADERS.match(header):
            self.complain(name, line, f"<{header}>: programs that are started inherit its files: use system/whole_file.hpp, "
                          "or std::fopen with 'e'")
        if layer in SANS_IO and NOT_SANS_IO.match(header) and header not in WITHOUT_IO.get(name, set()):
            self.complain(name, line, f"<{header}>: {layer} is sans-I/O")
        if layer == "public" and HEAVY_IN_PUBLIC.match(header):
            self.complain(name, line, f"<{header}> costs every user seconds: keep it out of public headers")

        target = self.resolve(name, quote, header)
        if target is None:
            if (quote == '"' and layer in LIBRARY) or header.startswith("cles/"):
                self.complain(name, line, f'"{header}" is not a file of this project')
            return
        target_layer = self.layer_of(target)
        allowed = MAY_INCLUDE[layer] | EXCEPTIONS.get(name, set()) | {layer}
        if target_layer in allowed:
            return
        if target_layer == "public":
            public = target.removeprefix("libcles/include/")
            if "link" in allowed and public in LINK_HEADERS:
                return
            if public in FACADE_HEADERS and layer in LIBRARY:
                self.complain(name, line, f"{layer} must not include the facade: <{public}>")
                return
            if "below_facade" in allowed:
                return
            if "plain" in allowed:
                reason = self.why_not_plain(target)
                if reason:
                    self.complain(name, line, f"{layer} may include only public headers that are sans-I/O: {reason}")
                return
        self.complain(name, line, f"{layer} must not include {target_layer}: {target}")

    def check_file(self, name: str) -> None:
        text = self.texts[name]
        layer = self.layer_of(name)
        for line, quote, header in self.includes[name]:
            self.check_include(name, line, quote, header)

        parts = name.split("/")
        if layer == "src" and len(parts) > 3:
            self.complain(name, 1, f"libcles/src/{parts[2]}/ is not a known layer: add it to LAYERS in "
                          "test/rules/include_rules.py")

        clean = without_comments_and_strings(text)
        if layer in SANS_IO:
            for pattern, what in NOT_SANS_IO_WORDS:
                for match in pattern.finditer(clean):
                    if match.group(0).removeprefix("std::") in WITHOUT_IO.get(name, set()):
                        continue
                    self.complain(name, clean.count("\n", 0, match.start()) + 1, f"'{match.group(0)}': sans-I/O code {what}")
        if layer in INHERITED_LAYERS:
            for line, statement in statements_of(clean):
                for pattern, what in INHERITED:
                    if match := pattern.search(statement):
                        self.complain(name, line, f"'{match.group(0)[:40]}': {what}")
        private = {**dict.fromkeys(LIBRARY, "transport"), "apps": "system", "runtime": "system"}.get(layer)
        if private and name != "libcles/src/transport/private_socket.hpp":
            for match in INHERITED_OF_ASIO.finditer(clean):
                self.complain(name, clean.count("\n", 0, match.start()) + 1,
                              f"'{match.group(0)}': programs that are started inherit it: use {private}/private_socket.hpp")
        if (layer in LIBRARY | {"runtime"} or name.startswith("apps/gateway/")) and name != "libcles/src/transport/ip_host.cpp":
            for match in LOOKUP.finditer(clean):
                self.complain(name, clean.count("\n", 0, match.start()) + 1,
                              f"'{match.group(0)}': others would wait for a slow name: use transport/host_lookup.hpp, or "
                              "a link_transport")
        if layer in LIBRARY:
            for match in CATEGORY.finditer(clean):
                if not CATEGORY_ID.search(match["body"]):
                    self.complain(name, clean.count("\n", 0, match.start()) + 1,
                                  "a category of errors without an id: pass a random 64-bit number to its base")
        if layer == "public":
            for match in self.unqualified_call.finditer(clean) if self.unqualified_call else ():
                self.complain(name, clean.count("\n", 0, match.start(1)) + 1,
                              f"'{match.group(1)}(' is not qualified: a user's function of that name may be called instead")
            for match in STRUCTURED_BINDING.finditer(clean):
                self.complain(name, clean.count("\n", 0, match.start()) + 1,
                              "a structured binding may call a user's 'get': name the members")
        if "co_await" in clean:
            for line, statement in statements_of(clean):
                if has_conditional_await(statement):
                    self.complain(name, line, "co_await under ?:, && or ||: g++ 12 compiles it wrongly; await first, then decide")

    def check(self) -> list[str]:
        for name in self.texts:
            self.check_file(name)
        return self.violations

    def report(self) -> str:
        lengths = {n: t.count("\n") for n, t in self.texts.items() if n.startswith("libcles/")}
        if not lengths:
            return "include rules: no library sources yet"
        longest = sorted(lengths, key=lambda n: -lengths[n])[:5]
        lines = [f"include rules: {len(self.texts)} files, {sum(map(len, self.includes.values()))} includes checked",
                 f"libcles: median {statistics.median(lengths.values()):.0f} lines, longest:"]
        lines += [f"  {lengths[n]:4} {n}" for n in longest]
        return "\n".join(lines)


# --- The self-test -------------------------------------------------------------------------------------------------------

# A tree that follows the rules, including code that only looks forbidden.
GOOD = {
    "libcles/include/cles/error.hpp": "#pragma once\n#include <string>\n",
    "libcles/include/cles/convert.hpp": "#pragma once\ntemplate <class T>\nvoid write(const T& value);\n\n"
    "template <class T>\n    requires(true)\nvoid twice(const T& value) {\n    cles::write(value); // write(value)\n"
    "    out.write(value);\n}\nstruct sink {\n    void write(int value);\n};\n",
    "libcles/src/transport/private_socket.cpp": "int f() { return ::socket(1, 2 | SOCK_CLOEXEC, 0); }\n",
    "libcles/include/cles/link.hpp": "#pragma once\n#include <cles/error.hpp>\n#include <boost/asio/awaitable.hpp>\n",
    "libcles/include/cles/registrar.hpp": "#pragma once\n#include <cles/link.hpp>\n",
    "libcles/include/cles/service.hpp": "#pragma once\n#include <boost/asio/io_context.hpp>\n",
    "libcles/src/protocol/line.hpp": '#include <cles/error.hpp>\n#include <chrono>\n// #include <boost/asio.hpp>\n',
    "libcles/src/node/session.cpp": '#include "protocol/line.hpp"\n#include <cles/registrar.hpp>\n#include <random>\n'
    'const char* text = "steady_clock::now()"; // steady_clock::now()\nvoid f(std::mt19937& chance);\n',
    "libcles/src/transport/tcp.cpp": '#include <cles/link.hpp>\n#include "protocol/line.hpp"\n#include <boost/asio/ip/tcp.hpp>\n'
    "task f() {\n  auto&& x = co_await g(a && b);\n  if (a && b) {\n    co_await h(c ? d : e);\n  }\n  z(a || b, co_await q());\n}\n",
    "libcles/src/api/connection.cpp": '#include "node/session.hpp"\n#include <cles/registrar.hpp>\n',
    "libcles/src/asio/dial.cpp": '#include "node/session.hpp"\n#include "transport/tcp.hpp"\n#include <boost/asio/post.hpp>\n',
    "libcles/src/node/session.hpp": "#pragma once\n",
    "libcles/src/protocol/error.cpp": "class ours final : public boost::system::error_category {\n  public:\n"
    "    constexpr ours() noexcept : error_category(0x1234U) {}\n};\n",
    "libcles/src/node/secured/signer.hpp": "#pragma once\n",
    "libcles/src/node/secured/signer.cpp": '#include "node/secured/signer.hpp"\n',
    "libcles/src/transport/tcp.hpp": "#pragma once\n",
    "libcles/src/security/keys/keys.cpp": '#include "json/reader.hpp"\n#include "security/keys/secret.hpp"\n#include <sodium.h>\n',
    "libcles/src/security/keys/secret.hpp": "#pragma once\n",
    "libcles/src/security/keys/secret.cpp": "#include <mutex>\nstatic std::mutex guard;\n",
    "libcles/src/json/reader.hpp": "#pragma once\n",
    "libcles/src/tls/engine.hpp": '#include "security/keys/secret.hpp"\n#include "transport/tcp.hpp"\n#include <openssl/ssl.h>\n',
    "libcles/src/api/service.cpp": '#include <cles/service.hpp>\n#include "api/connection.hpp"\n',
    "libcles/src/api/connection.hpp": "#pragma once\n",
    "runtime/src/config/config.cpp": "#include <yaml-cpp/yaml.h>\n#include <cles/service.hpp>\n",
    "runtime/src/isolation/filter.cpp": "#include <linux/filter.h>\n#include <linux/seccomp.h>\n",
    "runtime/src/plugins/plugin_library.cpp": "#include <boost/dll/shared_library.hpp>\n",
    "apps/car/main.cpp": '#include <cles/service.hpp>\n#include "car.hpp"\n#include <boost/asio.hpp>\n',
    "apps/car/car.hpp": "#pragma once\n",
    "test/unit/session_test.cpp": '#include "node/session.hpp"\n#include "support/clock.hpp"\n',
    "test/support/clock.hpp": "#pragma once\n",
}

# One violation each: the file, its text, and a part of the expected message.
PLANTED = [
    ("libcles/src/protocol/a.cpp", '#include "node/session.hpp"\n', "protocol must not include node"),
    ("libcles/src/protocol/a.cpp", '#include "../node/session.hpp"\n', "protocol must not include node"),
    ("libcles/src/protocol/a.cpp", "#include <cles/service.hpp>\n", "must not include the facade"),
    ("libcles/src/protocol/a.cpp", "#include <cles/registrar.hpp>\n", "registrar.hpp -> cles/link.hpp -> boost/asio/awaitable.hpp"),
    ("libcles/src/protocol/a.cpp", "#include <boost/asio/buffer.hpp>\n", "protocol is sans-I/O"),
    ("libcles/src/node/a.cpp", "#include <cles/service.hpp>\n", "must not include the facade"),
    ("libcles/src/node/a.cpp", "#include <boost/asio/any_io_executor.hpp>\n", "node is sans-I/O"),
    ("libcles/src/node/a.cpp", "#  include <thread>\n", "node is sans-I/O"),
    ("libcles/src/node/a.cpp", "#include <sys/socket.h>\n", "node is sans-I/O"),
    ("libcles/src/node/a.cpp", '#include "transport/tcp.hpp"\n', "node must not include transport"),
    ("libcles/src/node/a.cpp", '#include "api/connection.hpp"\n', "node must not include api"),
    ("libcles/src/node/a.cpp", "auto t = std::chrono::steady_clock::now();\n", "reads a clock"),
    ("libcles/src/node/a.cpp", "auto t = clock::now();\n", "reads a clock"),
    ("libcles/src/node/a.cpp", "std::random_device entropy;\n", "global chance"),
    ("libcles/src/node/a.cpp", "static std::mt19937 chance;\n", "global generator"),
    ("libcles/src/transport/a.cpp", '#include "node/session.hpp"\n', "transport must not include node"),
    ("libcles/src/transport/a.cpp", '#include "api/connection.hpp"\n', "transport must not include api"),
    ("libcles/src/transport/a.cpp", "#include <cles/service.hpp>\n", "must not include the facade"),
    ("libcles/src/node/a.cpp", '#include "security/keys/secret.hpp"\n', "node must not include security"),
    ("libcles/src/transport/a.cpp", "#include <sodium.h>\n", "libsodium belongs to security alone"),
    ("libcles/src/node/a.cpp", '#include "node/secured/signer.hpp"\n', "programs without security do not contain it"),
    ("libcles/src/security/a.cpp", "#include <openssl/ssl.h>\n", "OpenSSL belongs to tls alone"),
    ("libcles/src/transport/a.cpp", '#include "tls/engine.hpp"\n', "transport must not include tls"),
    ("libcles/src/security/a.cpp", "#include <fcntl.h>\n", "security is sans-I/O"),
    ("libcles/src/security/a.cpp", '#include "node/session.hpp"\n', "security must not include node"),
    ("libcles/src/security/keys/secret.cpp", "static std::mutex guard;\nstd::thread t;\n", "waits, locks or starts threads"),
    ("apps/shared/output/a.cpp", '#include "config/config.cpp"\n', "programs must not include runtime"),
    ("apps/cles/output/a.cpp", "#include <thread>\n", "this program has one thread"),
    ("libcles/src/api/a.cpp", '#include "nowhere.hpp"\n', "is not a file of this project"),
    ("libcles/src/util/a.cpp", "int a;\n", "is not a known layer"),
    ("libcles/include/cles/a.hpp", '#include "protocol/line.hpp"\n', "public must not include protocol"),
    ("libcles/include/cles/a.hpp", "#include <boost/asio/use_future.hpp>\n", "costs every user seconds"),
    ("libcles/include/cles/a.hpp", "#include <boost/asio/experimental/awaitable_operators.hpp>\n", "costs every user seconds"),
    ("libcles/include/cles/a.hpp", "#include <boost/asio.hpp>\n", "costs every user seconds"),
    ("libcles/include/cles/a.hpp", "template <class T>\nvoid f(const T& value) {\n    write(value);\n}\n", "'write(' is not qualified"),
    ("libcles/include/cles/a.hpp", "template <class T>\nbool f(T& value) {\n    return twice(value);\n}\n", "'twice(' is not"),
    ("libcles/include/cles/a.hpp", "template <class T>\nvoid f(T& all) {\n    for (auto& [a, b] : all) {\n    }\n}\n", "structured binding"),
    ("libcles/src/transport/a.cpp", "void f() { socket.open(where.protocol(), code); }\n", "use transport/private_socket.hpp"),
    ("libcles/src/transport/a.cpp", "a::a() : socket_(executor, udp::v4()) {}\n", "use transport/private_socket.hpp"),
    ("libcles/src/transport/a.cpp", "void f() { acceptor_.async_accept(g); }\n", "use transport/private_socket.hpp"),
    ("libcles/src/transport/a.cpp", "void f() { resolver_.async_resolve(g); }\n", "use transport/host_lookup.hpp"),
    ("runtime/a.cpp", "boost::asio::ip::tcp::resolver made{io};\n", "use transport/host_lookup.hpp"),
    ("apps/gateway/a.cpp", "void f() { resolver_.async_resolve(g); }\n", "or a link_transport"),
    ("apps/a.cpp", "void f() { socket.open(where.protocol(), code); }\n", "use system/private_socket.hpp"),
    ("runtime/a.cpp", "#include <fstream>\n", "use system/whole_file.hpp"),
    ("libcles/src/protocol/a.cpp", "class ours final : public boost::system::error_category {\n  public:\n    int f();\n};\n",
     "without an id"),
    ("runtime/a.cpp", "int f() { return ::socket(1, 2, 0); }\n", "close-on-exec is missing"),
    ("apps/a.cpp", "int f() { return ::dup(0); }\n", "programs that are started inherit it"),
    ("apps/a.cpp", '#include "../libcles/src/node/session.hpp"\n', "apps must not include node"),
    ("apps/a.cpp", '#include "protocol/line.hpp"\n', "apps must not include protocol"),
    ("apps/a.cpp", "#include <yaml-cpp/yaml.h>\n", "runtime/config alone"),
    ("perf/a.cpp", '#include "api/connection.hpp"\n', "perf must not include api"),
    ("plugins/a.cpp", '#include "runtime/config.hpp"\n#include <cles/nowhere.hpp>\n', "is not a file of this project"),
    ("runtime/a.cpp", "#include <boost/dll.hpp>\n", "runtime/plugins/plugin_library alone"),
    ("runtime/a.cpp", "#include <linux/ioprio.h>\n", "define the constants"),
    ("runtime/a.cpp", '#include "node/session.hpp"\n', "runtime must not include node"),
    ("apps/a.cpp", "task f() { if (ready && co_await g()) { } }\n", "co_await under"),
    ("apps/a.cpp", "task f() { x = co_await g() || y; }\n", "co_await under"),
    ("apps/a.cpp", "task f() { return use(ready ? (co_await g()).x : 0); }\n", "co_await under"),
    ("apps/a.cpp", "task f() { auto x = a\n  && b(1, co_await g()); }\n", "co_await under"),
]


def write_tree(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def self_test() -> int:
    failures = []
    with tempfile.TemporaryDirectory() as scratch:
        write_tree(Path(scratch), GOOD)
        failures += [f"found in a tree that keeps the rules: {v}" for v in Tree(Path(scratch)).check()]
    for name, text, expected in PLANTED:
        with tempfile.TemporaryDirectory() as scratch:
            write_tree(Path(scratch), {**GOOD, name: text})
            found = Tree(Path(scratch)).check()
            if len(found) != 1 or not found[0].startswith(name) or expected not in found[0]:
                failures.append(f"{name}: {text.strip()[:60]!r}: expected one '{expected}', found {found}")
    for failure in failures:
        print(failure)
    print(f"include rules, self-test: {len(PLANTED)} violations planted, {len(failures)} mistakes")
    return 1 if failures else 0


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        return self_test()
    tree = Tree(Path(arguments[0] if arguments else Path(__file__).parents[2]))
    for violation in tree.check():
        print(violation)
    print(tree.report())
    return 1 if tree.violations else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
