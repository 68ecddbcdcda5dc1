// SPDX-License-Identifier: BSL-1.0
#include "system/whole_file.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>

namespace tool {
namespace {

struct owned_descriptor {
    explicit owned_descriptor(int opened) noexcept : number(opened) {}
    owned_descriptor(const owned_descriptor&) = delete;
    owned_descriptor& operator=(const owned_descriptor&) = delete;
    ~owned_descriptor() {
        if (number >= 0) {
            ::close(number);
        }
    }

    const int number;
};

} // namespace

std::error_code read_file(const std::string& path, std::string& to, std::size_t most) {
    to.clear();
    const owned_descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
    if (file.number < 0) {
        return {errno, std::generic_category()};
    }
    return read_open_file(file.number, to, most);
}

std::error_code read_open_file(int descriptor, std::string& to, std::size_t most) {
    constexpr std::size_t step = 65'536;
    to.clear();
    for (;;) {
        const auto before = to.size();
        to.resize(before + std::min(most - before, step));
        const auto count = ::read(descriptor, to.data() + before, to.size() - before);
        const int why = count < 0 ? errno : 0;
        to.resize(before + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
        if (count == 0 || (why != 0 && why != EINTR)) {
            return {why, std::generic_category()};
        }
    }
}

} // namespace tool
