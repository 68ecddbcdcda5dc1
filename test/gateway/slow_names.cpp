// SPDX-License-Identifier: BSL-1.0
// Preloaded, it makes lookups of names that end in ".slow.test" hang for ever, after a line on stderr that says so.
#include <cstdio>
#include <string_view>

#include <dlfcn.h>
#include <netdb.h>
#include <unistd.h>

extern "C" int getaddrinfo(const char* node, const char* service, const addrinfo* hints, addrinfo** result) {
    using function = int (*)(const char*, const char*, const addrinfo*, addrinfo**);
    static const auto real = reinterpret_cast<function>(::dlsym(RTLD_NEXT, "getaddrinfo"));
    if (node != nullptr && std::string_view{node}.ends_with(".slow.test")) {
        ::dprintf(STDERR_FILENO, "%s is being looked up\n", node);
        for (;;) {
            ::pause();
        }
    }
    return real(node, service, hints, result);
}
