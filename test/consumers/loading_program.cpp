// SPDX-License-Identifier: BSL-1.0
// A program that loads a shared library; both contain CLES.
#include <cles/error.hpp>

#include <iostream>

#include <dlfcn.h>

namespace {

template <class F>
F* find(void* library, const char* name) {
    return reinterpret_cast<F*>(::dlsym(library, name));
}

bool is_denied(void (*thrower)()) {
    try {
        thrower();
    } catch (const cles::error& e) {
        return e.code() == cles::errc::denied;
    }
    return false;
}

} // namespace

int main(int, char** argv) {
    void* library = ::dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
        std::cout << ::dlerror() << '\n';
        return 1;
    }
    const bool theirs = is_denied(find<void()>(library, "my_library_throws_denied"));
    const bool ours =
        find<bool(const boost::system::error_code&)>(library, "my_library_knows_denied")(cles::errc::denied);
    std::cout << (theirs ? "its denied is denied" : "its denied is another")
              << (ours ? ", ours is too" : ", ours is not") << ", its service says "
              << find<double()>(library, "my_library_serves")() << '\n';
}
