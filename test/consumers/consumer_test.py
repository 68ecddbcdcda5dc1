#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Uses the library as another project does, in one of three ways, and runs what comes out.

    consumer_test.py WAY --cmake CMAKE --compiler CXX --source ROOT --build BUILD --scratch FOLDER --version VERSION

WAY: install, find_package, pkg_config or add_subdirectory. FOLDER is emptied first.
"""

import argparse
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

from foreign_project import ForeignProject, expect

HERE = Path(__file__).resolve().parent
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)\s]*)?\)")


class Consumer(ForeignProject):
    def configure(self, folder: str, *settings: str) -> Path:
        build = self.scratch / "build"
        launcher = shutil.which("ccache")
        if launcher:
            settings += (f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",)
        self.run(self.options.cmake, "-G", "Ninja", "-S", HERE / folder, "-B", build,
                 f"-DCMAKE_CXX_COMPILER={self.options.compiler}", *settings)
        return build

    def check(self, program: Path) -> None:
        printed = self.run(program)
        wanted = f'{self.options.version} 48 {{"lat":48.137154,"lon":11.576124}}\n'
        expect(printed == wanted, f"it printed {printed!r}, not {wanted!r}")
        needed = self.run("ldd", program)
        expect("boost" not in needed, f"it depends on Boost at run time:\n{needed}")


def check_links(pages: Path) -> int:
    """The links between installed pages have existing targets."""
    count = 0
    for page in sorted(pages.rglob("*.md")):
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            if not re.match(r"[a-z][a-z0-9+.-]*:", target):
                count += 1
                expect((page.parent / unquote(target)).exists(), f"{page.name}: the link to '{target}' leads nowhere")
    return count


def check_daemon(consumer: Consumer, clesd: Path) -> None:
    """The installed daemon finds and loads the installed plugins by their names alone."""
    if not clesd.exists():  # it was not built, and nothing of it is installed
        expect(not list(clesd.parents[1].rglob("libcles-*.so")), "there are plugins without a daemon")
        return
    config = consumer.scratch / "clesd.yaml"
    config.write_text("listen: tcp://127.0.0.1:0\nmulticast: off\nplugins: [libcles-system.so, libcles-primes.so]\n")
    daemon = subprocess.Popen([clesd, "--config", config], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        port = re.search(r"listening on tcp://127\.0\.0\.1:(\d+)", daemon.stdout.readline())
        expect(port is not None, "clesd does not start")
        with socket.create_connection(("127.0.0.1", int(port[1])), 20) as link:
            link.sendall(b"PULL self:prime/97\n")
            expect(link.makefile().readline() == '{"value":true}\n', "clesd does not compute")
        daemon.terminate()
        _, log = daemon.communicate(timeout=20)
    except (AssertionError, OSError, subprocess.TimeoutExpired) as failure:
        daemon.kill()
        raise AssertionError(f"{failure}; it logged\n{daemon.communicate()[1]}") from None
    expect(daemon.returncode == 0 and "plugin system" in log, f"clesd ended with {daemon.returncode}:\n{log}")


def check_case_studies(consumer: Consumer, prefix: Path) -> None:
    """The programs and plugins of the case studies are only installed as a component."""
    wanted = {"cles-dsgd", "cles-jadc2", "cles-platoon", "libcles-fmv.so", "libcles-sgd.so", "libcles-strike.so"}
    by_default = wanted & {file.name for file in prefix.rglob("*")}
    expect(not by_default, f"installed without being asked for: {by_default}")

    component = consumer.scratch / "case_studies"
    consumer.run(consumer.options.cmake, "--install", consumer.options.build, "--prefix", component,
                 "--component", "case_studies")
    installed = {file.name for file in component.rglob("*") if file.is_file()}
    expect(installed == wanted, f"the component contains {installed}, not {wanted}")


def install(consumer: Consumer) -> None:
    prefix = consumer.install()
    check_case_studies(consumer, prefix)
    source = consumer.options.source
    for public in (source / "libcles" / "include").rglob("*.hpp"):
        name = public.relative_to(source / "libcles")
        if "security" in name.parts:  # its library is not installed
            expect(not (prefix / name).exists(), f"{name} is installed")
            continue
        expect((prefix / name).read_bytes() == public.read_bytes(), f"{name} is not installed as it is")
    expect(consumer.run(prefix / "bin" / "cles", "--version") == f"cles {consumer.options.version}\n", "cles --version")
    check_daemon(consumer, prefix / "bin" / "clesd")

    for name, place in (("cles.bash", "bash-completion/completions/cles"), ("_cles", "zsh/site-functions/_cles"),
                        ("cles.fish", "fish/vendor_completions.d/cles.fish")):
        expect((prefix / "share" / place).read_bytes() == (source / "apps" / "completion" / name).read_bytes(),
               f"{name} is not where its shell looks")

    pages = prefix / "share" / "doc" / "cles"
    expect("Boost Software License" in (pages / "LICENSE").read_text(), "the licence is not that of Boost")
    expect((pages / "docs" / "protocol.md").is_file(), "the protocol's page is missing")
    expect(check_links(pages) > 20, "the installed pages should link to each other")

    # Nothing contains a path of this machine, or what only tests need.
    for file in (f for f in prefix.rglob("*") if f.is_file()):
        data = file.read_bytes()
        for place in (source, consumer.options.build, consumer.scratch):
            # '/tmp/w' is not named by '/tmp/wrong.yaml'.
            named = re.search(re.escape(str(place).encode()) + rb"(?![\w.-])", data)
            expect(named is None, f"{file.relative_to(prefix)} names {place}")
    expect(not list(prefix.rglob("*test*")), "tests were installed")


def find_package(consumer: Consumer) -> None:
    prefix = consumer.install()
    build = consumer.configure("find_package", f"-DCMAKE_PREFIX_PATH={prefix}",
                               f"-DEXPECTED_VERSION={consumer.options.version}")
    consumer.run(consumer.options.cmake, "--build", build)
    consumer.check(build / "my_program")
    # Compiled with Asio's functions from the library or with its own, or partly with each.
    consumer.check(build / "my_header_only_program")
    printed = consumer.run(build / "my_mixed_program")
    expect(printed == 'one category, 2 signals, {"value":27.5}\n', f"the mixed program printed {printed!r}")


def pkg_config(consumer: Consumer) -> None:
    prefix = consumer.install()
    places = {"PKG_CONFIG_PATH": str(next(prefix.rglob("cles.pc")).parent)}
    version = consumer.run("pkg-config", "--modversion", "cles", environment=places).strip()
    expect(version == consumer.options.version, f"pkg-config says version {version}")
    launcher = [found] if (found := shutil.which("ccache")) else []
    for asio_flags, separate in (((), True), (("--define-variable=asio_cflags=",), False)):
        flags = consumer.run("pkg-config", *asio_flags, "--cflags", "--libs", "cles", environment=places).split()
        expect(("-DBOOST_ASIO_SEPARATE_COMPILATION" in flags) == separate, f"with {asio_flags} the flags are {flags}")
        compiled = [flag for flag in flags if flag.startswith(("-I", "-D", "-isystem", "-pthread"))]
        linked = [flag for flag in flags if flag not in compiled or flag == "-pthread"]
        # In two steps, which ccache caches.
        object_file = consumer.scratch / "consumer.o"
        consumer.run(*launcher, consumer.options.compiler, "-std=c++20", "-c", HERE / "consumer.cpp", "-o", object_file,
                     *compiled)
        program = consumer.scratch / "my_program"
        consumer.run(consumer.options.compiler, object_file, "-o", program, *linked)
        consumer.check(program)


def add_subdirectory(consumer: Consumer) -> None:
    source = f"-DCLES_SOURCE_DIR={consumer.options.source}"
    # Asked for, the programs come along; only configured here.
    consumer.configure("add_subdirectory", source, "-DCLES_BUILD_APPS=ON", "-DCLES_BUILD_PERF=ON",
                       "-DEXPECTED_TARGETS=cles;cles_command;cles_minimal")
    shutil.rmtree(consumer.scratch / "build")

    build = consumer.configure("add_subdirectory", source)
    consumer.run(consumer.options.cmake, "--build", build)
    consumer.check(build / "my_program")
    # Installing another project does not install the library.
    consumer.run(consumer.options.cmake, "--install", build, "--prefix", consumer.scratch / "prefix")
    expect(not (consumer.scratch / "prefix").exists(), "the library is part of another project's installation")


WAYS = {way.__name__: way for way in (install, find_package, pkg_config, add_subdirectory)}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("way", choices=WAYS)
    parser.add_argument("--cmake", required=True)
    parser.add_argument("--compiler", required=True)
    for name in ("source", "build", "scratch"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--version", required=True)
    options = parser.parse_args()
    try:
        WAYS[options.way](Consumer(options))
    except AssertionError as failure:
        print(failure)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
