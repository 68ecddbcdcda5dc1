// SPDX-License-Identifier: BSL-1.0
// Plugins with one fault each, selected by FAULT_..., written against the bare C entry point.
#include <cles/plugin_abi.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include <sys/prctl.h>
#include <unistd.h>

namespace {

constexpr cles_text text_of(const char* text, size_t size) { return {text, size}; }

[[noreturn, maybe_unused]] void hang() {
    for (;;) {
        pause();
    }
}

// Exhausts the stack.
[[maybe_unused]] int deeper(int depth) { // NOLINT(misc-no-recursion)
    volatile char frame[4096] = {};
    frame[depth % 4096] = 1;
    return depth < 0 ? 0 : deeper(depth + 1) + frame[0];
}

// Whether this process only tries the library, and ends with its parent.
[[maybe_unused]] bool is_tried() {
    int with_parent = 0;
    return ::prctl(PR_GET_PDEATHSIG, &with_parent) == 0 && with_parent == SIGKILL;
}

[[maybe_unused]] int32_t check(const cles_host* host, cles_text) {
#if defined(FAULT_CRASHES_IN_CHECK)
    (void)host;
    std::abort();
#elif defined(FAULT_TALKS_AND_CRASHES)
    (void)host;
    for (int line = 0; line < 5000; ++line) {
        std::fprintf(stderr, "looked at sensor %d\n", line);
    }
    std::fprintf(stderr, "assertion failed: no sensor is left\n");
    std::abort();
#elif defined(FAULT_LEAVES_A_PROCESS)
    (void)host;
    if (is_tried() && ::fork() == 0) { // keeps stdout open
        ::alarm(20);
        hang();
    }
    return 0;
#elif defined(FAULT_CLOSES_OUTPUT_AND_HANGS)
    (void)host;
    ::close(STDOUT_FILENO);
    ::close(STDERR_FILENO);
    hang();
#elif defined(FAULT_REFUSES_SETTING)
    host->refuse_setting(host, text_of("cameras[1].rate", 15), text_of("60 at most", 10));
    return 1;
#else
    (void)host;
    return 0;
#endif
}

[[maybe_unused]] int32_t start(const cles_host* host, cles_text) {
#if defined(FAULT_THROWS_IN_START)
    (void)host;
    throw std::runtime_error{"no such device"};
#elif defined(FAULT_CRASHES_IN_START)
    (void)host;
    std::raise(SIGSEGV);
    return 0;
#elif defined(FAULT_OVERFLOWS_IN_START)
    (void)host;
    return deeper(1) == 7 ? 1 : 0;
#elif defined(FAULT_EXITS_IN_START)
    (void)host;
    std::exit(0);
#elif defined(FAULT_HANGS_IN_START)
    (void)host;
    hang();
#elif defined(FAULT_REFUSES)
    host->refuse(host, text_of("the device is on fire", 21));
    return 1;
#elif defined(FAULT_REFUSES_SILENTLY)
    (void)host;
    return 1;
#elif defined(FAULT_BAD_TASKS)
    cles_task task{};
    task.size = sizeof task;
    task.verb = CLES_PULL;
    task.name = text_of("nothing", 7);
    if (host->add_task(host, &task) != CLES_BAD_TASK) { // no handler
        return 2;
    }
    task.verb = 17;
    if (host->add_task(host, &task) != CLES_BAD_TASK) { // no verb
        return 3;
    }
    task = {};
    task.size = 4;
    if (host->add_task(host, &task) != CLES_BAD_TASK) { // no name, according to the size
        return 4;
    }
    return 1;
#elif defined(FAULT_BAD_TYPES)
    cles_task task{};
    task.size = sizeof task;
    task.verb = CLES_BIND;
    task.name = text_of("noun", 4);
    task.types = text_of(R"({"updates":{"oneOf":[]}})", 24);
    return host->add_task(host, &task) == CLES_BAD_TASK ? 1 : 0;
#else
    (void)host;
    return 0;
#endif
}

#if defined(FAULT_WRONG_MAJOR)
constexpr uint32_t major = CLES_PLUGIN_ABI_MAJOR + 1;
#else
constexpr uint32_t major = CLES_PLUGIN_ABI_MAJOR;
#endif
#if defined(FAULT_NEWER_MINOR)
constexpr uint32_t minor = CLES_PLUGIN_ABI_MINOR + 7;
#else
constexpr uint32_t minor = CLES_PLUGIN_ABI_MINOR;
#endif
#if defined(FAULT_TOO_SHORT)
constexpr uint32_t size = 8;
#elif defined(FAULT_LACKS_START)
constexpr uint32_t size = 32;
#else
constexpr uint32_t size = sizeof(cles_plugin);
#endif

[[maybe_unused]] const cles_plugin description{.size = size,
                                               .abi_major = major,
                                               .abi_minor = minor,
                                               .reserved = 0,
                                               .name = text_of("faulty", 6),
                                               .version = text_of("0", 1),
                                               .start = &start,
                                               .stop = nullptr,
                                               .check = &check};

#if defined(FAULT_THROWS_WHEN_LOADED)
struct at_load {
    at_load() { throw std::runtime_error{"thrown by a global object"}; }
} const loaded;
#elif defined(FAULT_HANGS_WHEN_LOADED)
struct at_load {
    at_load() {
        for (;;) {
            pause();
        }
    }
} const loaded;
#elif defined(FAULT_EXITS_WHEN_LOADED)
struct at_load {
    at_load() { _exit(0); }
} const loaded;
#endif

} // namespace

#if defined(FAULT_UNDEFINED_SYMBOL)
extern "C" int cles_test_nobody_has_this();
#endif

#if defined(FAULT_OTHER_VERSION)
extern "C" CLES_PLUGIN_EXPORT const cles_plugin* cles_plugin_v2() { return &description; }
#elif defined(FAULT_NO_ENTRY)
extern "C" CLES_PLUGIN_EXPORT int something_else() { return 1; }
#else
extern "C" CLES_PLUGIN_EXPORT const cles_plugin* cles_plugin_v1() {
#if defined(FAULT_DESCRIBES_NOTHING)
    return nullptr;
#elif defined(FAULT_THROWS_IN_ENTRY)
    throw std::runtime_error{"not today"};
#elif defined(FAULT_CRASHES_IN_ENTRY)
    std::raise(SIGSEGV);
    return &description;
#elif defined(FAULT_HANGS_IN_ENTRY)
    hang();
#elif defined(FAULT_UNDEFINED_SYMBOL)
    return cles_test_nobody_has_this() != 0 ? &description : nullptr;
#else
    return &description;
#endif
}
#endif
