#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Uses the library as another project does, in one of several ways, and runs what comes out.

    consumer_test.py WAY --cmake CMAKE --compiler CXX --source ROOT --build BUILD --scratch FOLDER --version VERSION

WAY: install, find_package, find_security, find_shared, pkg_config, settings, add_subdirectory or clang. FOLDER is emptied
first. Beside it are those of the other ways: `install` leaves the library installed for all but the last two, `find_package`
its objects for `pkg_config`.
"""

import argparse
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

from compilation import Compilation, compilations_in
from foreign_project import ForeignProject, expect

HERE = Path(__file__).resolve().parent
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)\s]*)?\)")
# Settings of a program with which it does not link, and what the linker says.
DIFFERENT = {
    "-fno-rtti": "no_rtti",
    "-D_GLIBCXX_DEBUG": "glibcxx_debug",
    "-D_GLIBCXX_USE_CXX11_ABI=0": "no_glibcxx_use_cxx11_abi",
    "-DBOOST_ASIO_ENABLE_HANDLER_TRACKING": "asio_enable_handler_tracking",
    "-DBOOST_ASIO_DISABLE_THREADS": "asio_disable_threads",
}
# What the library adds in some kinds of build and on some machines, and what only our own code is held to.
OURS = ("-Os", "-D_GLIBCXX_ASSERTIONS", "-Werror", "--param=ggc-min-heapsize=1000000")


class Consumer(ForeignProject):
    @property
    def installed(self) -> Path:
        return self.scratch.parent / "install" / "prefix"

    def configure(self, folder: str, *settings: str, compiler: str = "") -> Path:
        build = self.scratch / "build"
        launcher = shutil.which("ccache")
        if launcher:
            settings += (f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",)
        self.run(self.options.cmake, "-G", "Ninja", "-S", HERE / folder, "-B", build,
                 f"-DCMAKE_CXX_COMPILER={compiler or self.options.compiler}", *settings)
        return build

    def objects(self, build: Path) -> dict[str, Compilation]:
        return compilations_in(self.run(setting(build, "CMAKE_MAKE_PROGRAM"), "-C", build, "-t", "compdb"))

    def pkg_config(self, package: str, *options: str) -> list[str]:
        places = {"PKG_CONFIG_PATH": str(next(self.installed.rglob(f"{package}.pc")).parent)}
        return self.run("pkg-config", *options, package, environment=places).split()

    def check_flags(self, flags: list[str], like: Compilation) -> None:
        """pkg-config has a source compiled as the package of CMake does. So one object shows that both work."""
        told = Compilation(like.source, tuple(flags))
        expect((told.definitions, told.folders) == (like.definitions, like.folders),
               f"pkg-config defines {told.definitions} and has headers in {told.folders}, CMake's package "
               f"{like.definitions} and {like.folders}")

    def check(self, program: Path) -> None:
        printed = self.run(program)
        wanted = f'{self.options.version} 48 {{"lat":48.137154,"lon":11.576124}}\n'
        expect(printed == wanted, f"it printed {printed!r}, not {wanted!r}")
        needed = self.run("ldd", program)
        expect("boost" not in needed, f"it depends on Boost at run time:\n{needed}")


def setting(build: Path, name: str) -> str:
    """The value of a variable in the cache of a build."""
    found = re.search(f"^{name}:\\w+=(.*)$", (build / "CMakeCache.txt").read_text(encoding="utf-8"), re.MULTILINE)
    expect(found is not None, f"{name} is not in the cache of {build}")
    return found[1]


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
    wanted = {"cles-dsgd", "cles-jadc2", "cles-platoon", "libcles-digits.so", "libcles-fmv.so", "libcles-sgd.so",
              "libcles-strike.so"}
    by_default = wanted & {file.name for file in prefix.rglob("*")}
    expect(not by_default, f"installed without being asked for: {by_default}")

    component = consumer.scratch / "case_studies"
    consumer.run(consumer.options.cmake, "--install", consumer.options.build, "--prefix", component,
                 "--component", "case_studies")
    installed = {file.name for file in component.rglob("*") if file.is_file()}
    expect(installed == wanted, f"the component contains {installed}, not {wanted}")


def has_security(prefix: Path) -> bool:
    return any(prefix.rglob("libcles_tls.a"))


def install(consumer: Consumer) -> None:
    prefix = consumer.install()
    expect(prefix == consumer.installed, f"the others look in {consumer.installed}")
    check_case_studies(consumer, prefix)
    source = consumer.options.source
    for public in (source / "libcles" / "include").rglob("*.hpp"):
        name = public.relative_to(source / "libcles")
        if not has_security(prefix) and ("security" in name.parts or name.name == "security.hpp"):
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

    # Nothing contains a path of this machine, but for the unit of systemd, or what only tests need.
    for file in (f for f in prefix.rglob("*") if f.is_file() and f.suffix != ".service"):
        data = file.read_bytes()
        for place in (source, consumer.options.build, consumer.scratch):
            # '/tmp/w' is not named by '/tmp/wrong.yaml'.
            named = re.search(re.escape(str(place).encode()) + rb"(?![\w.-])", data)
            expect(named is None, f"{file.relative_to(prefix)} names {place}")
    expect(not list(prefix.rglob("*test*")), "tests were installed")


def find_package(consumer: Consumer) -> None:
    build = consumer.configure("find_package", f"-DCMAKE_PREFIX_PATH={consumer.installed}",
                               f"-DEXPECTED_VERSION={consumer.options.version}")
    consumer.run(consumer.options.cmake, "--build", build)
    consumer.check(build / "my_program")
    # Compiled with Asio's functions from the library or with its own, or partly with each.
    consumer.check(build / "my_header_only_program")
    printed = consumer.run(build / "my_mixed_program")
    expect(printed == 'one category, 2 signals, {"value":27.5}\n', f"the mixed program printed {printed!r}")


def find_security(consumer: Consumer) -> None:
    build = consumer.configure("find_security", f"-DCMAKE_PREFIX_PATH={consumer.installed}")
    consumer.run(consumer.options.cmake, "--build", build)

    ((made, how),) = consumer.objects(build).items()
    consumer.check_flags(consumer.pkg_config("cles-tls", "--cflags"), how)
    program = consumer.scratch / "my_program"
    consumer.run(consumer.options.compiler, build / made, "-o", program, *consumer.pkg_config("cles-tls", "--libs"))
    for number, each in enumerate((build / "my_program", program)):
        printed = consumer.run(each, consumer.scratch / f"fleet{number}")
        expect(printed == "27.500000\n", f"it printed {printed!r}")


def find_shared(consumer: Consumer) -> None:
    """A shared library that contains the library, in a program that contains it too."""
    build = consumer.configure("find_shared", f"-DCMAKE_PREFIX_PATH={consumer.installed}")
    consumer.run(consumer.options.cmake, "--build", build)
    printed = consumer.run(build / "my_program", build / "libmy_library.so")
    expect(printed == "its denied is denied, ours is too, its service says 27.5\n", f"it printed {printed!r}")


def pkg_config(consumer: Consumer) -> None:
    (version,) = consumer.pkg_config("cles", "--modversion")
    expect(version == consumer.options.version, f"pkg-config says version {version}")
    build = consumer.scratch.parent / "find_package" / "build"
    objects = consumer.objects(build)
    for asio_flags, separate, name in (((), True, "my_program"),
                                       (("--define-variable=asio_cflags=",), False, "my_header_only_program")):
        flags = consumer.pkg_config("cles", *asio_flags, "--cflags")
        expect(("-DBOOST_ASIO_SEPARATE_COMPILATION" in flags) == separate, f"with {asio_flags} the flags are {flags}")
        (made,) = (output for output in objects if output.startswith(f"CMakeFiles/{name}.dir/"))
        consumer.check_flags(flags, objects[made])
        program = consumer.scratch / name
        consumer.run(consumer.options.compiler, build / made, "-o", program, *consumer.pkg_config("cles", "--libs"))
        consumer.check(program)


def settings(consumer: Consumer) -> None:
    """Programs with other settings than the library do not link, and the linker says why."""
    source = consumer.scratch / "program.cpp"
    source.write_text("#include <cles/error.hpp>\nint main() { return cles::error_category().name()[0] == 'c' ? 0 : 1; }\n")
    program = consumer.scratch / "program"
    made = (consumer.options.compiler, "-std=c++20", source, "-o", program, *consumer.pkg_config("cles", "--cflags", "--libs"))
    consumer.run(*made)
    consumer.run(program)
    for setting, told in DIFFERENT.items():
        # Sections that are not used are discarded, but not the references of the settings.
        printed = consumer.run(*made, setting, "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", fails=True)
        lines = [line for line in printed.splitlines() if f"differs_from_the_library::{told}'" in line]
        expect(len(lines) == 1, f"with {setting}, it printed:\n{printed}")
    printed = consumer.run(*made, "-fno-exceptions", fails=True)
    expect("CLES needs exceptions" in printed, f"with -fno-exceptions, it printed:\n{printed}")


def check_library_is_ours(consumer: Consumer, build: Path) -> None:
    """The sources of the library are compiled as in our own build, but for what the kind of build decides; so they compile
    there as they do here, and what is linked need not be made again. One of them is compiled, by the project's own rules."""
    ours = {output.removeprefix("libcles/"): how for output, how in
            compilations_in((consumer.options.build / "compile_commands.json").read_text(encoding="utf-8")).items()}
    theirs = {output.removeprefix("cles/libcles/"): how for output, how in consumer.objects(build).items()}
    parts = ("CMakeFiles/cles.dir/", "CMakeFiles/cles_compact.dir/")
    ours, theirs = ({output: how for output, how in each.items() if output.startswith(parts)} for each in (ours, theirs))
    kind = setting(consumer.options.build, "CMAKE_BUILD_TYPE").upper()
    left_out = {*OURS, *setting(consumer.options.build, f"CMAKE_CXX_FLAGS_{kind}").split()}
    expect(ours and set(ours) == set(theirs), f"the library has the objects {sorted(theirs)} there, and {sorted(ours)} here")
    for output, how in theirs.items():
        expect(how.source.read_bytes() == ours[output].source.read_bytes(), f"{output} is made from something else there")
        options = tuple(option for option in ours[output].options if option not in left_out)
        expect(how.options == options, f"{output} is compiled with {set(how.options) - set(options)} only there, and with "
               f"{set(options) - set(how.options)} only here")

    ninja, archive = setting(build, "CMAKE_MAKE_PROGRAM"), Path("cles", "libcles", "libcles.a")
    archived = re.findall(r"([^/\s]+\.o)(?=\s|$)", consumer.run(ninja, "-C", build, "-t", "commands", "-s", archive))
    held = consumer.run("ar", "t", consumer.options.build / "libcles" / "libcles.a").split()
    expect(sorted(archived) == sorted(held), f"the library is made of {sorted(archived)} there, and of {sorted(held)} here")
    consumer.run(ninja, "-C", build, "cles/libcles/" + max(output for output in theirs if "json" in output))
    shutil.copy(consumer.options.build / "libcles" / "libcles.a", build / archive)


def add_subdirectory(consumer: Consumer) -> None:
    source = f"-DCLES_SOURCE_DIR={consumer.options.source}"
    # Asked for, the programs come along; only configured here.
    build = consumer.configure("add_subdirectory", source, "-DCLES_BUILD_APPS=ON", "-DCLES_BUILD_PERF=ON",
                               "-DEXPECTED_TARGETS=cles;cles_command;cles_minimal")
    expect(setting(build, "CLES_UNITY") == "ON", "another project compiles each source of the library separately")
    shutil.rmtree(build)

    build = consumer.configure("add_subdirectory", source, *(f"-D{name}={setting(consumer.options.build, name)}"
                                                             for name in ("CLES_UNITY", "CMAKE_CXX_FLAGS")))
    check_library_is_ours(consumer, build)
    (made,) = (output for output in consumer.objects(build) if output.startswith("CMakeFiles/my_program.dir/"))
    ninja = setting(build, "CMAKE_MAKE_PROGRAM")
    consumer.run(ninja, "-C", build, made)
    # Linked by the project's own command, which ninja would run after it had made the library.
    consumer.run("sh", "-c", f"cd '{build}' && " + consumer.run(ninja, "-C", build, "-t", "commands", "-s", "my_program"))
    consumer.check(build / "my_program")
    # Installing another project does not install the library.
    consumer.run(consumer.options.cmake, "--install", build, "--prefix", consumer.scratch / "prefix")
    expect(not (consumer.scratch / "prefix").exists(), "the library is part of another project's installation")


def clang(consumer: Consumer) -> None:
    """The library and its users, compiled by clang."""
    compiler = next(filter(None, map(shutil.which, ("clang++-14", "clang++"))), None)
    if compiler is None:
        print("skipped: clang++ is missing; scripts/setup --dev installs it")
        sys.exit(77)
    build = consumer.configure("clang", f"-DCLES_SOURCE_DIR={consumer.options.source}", compiler=compiler)
    consumer.run(consumer.options.cmake, "--build", build, "--target", "my_program", "my_asio_program")
    consumer.check(build / "my_program")
    printed = consumer.run(build / "my_asio_program")
    expect(printed == "2 asked, 27.5\n", f"it printed {printed!r}")


WAYS = {way.__name__: way
        for way in (install, find_package, find_security, find_shared, pkg_config, settings, add_subdirectory, clang)}


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
