// SPDX-License-Identifier: BSL-1.0
#include "daemon/service_manager.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <optional>
#include <system_error>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace cles::runtime {

bool service_manager::notify(std::string_view state) const {
    if (socket_.empty()) {
        return true;
    }
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const bool is_abstract = socket_.front() == '@';
    // A path ends with a null character; an abstract name does not.
    if ((!is_abstract && socket_.front() != '/') || socket_.size() > sizeof(address.sun_path) - (is_abstract ? 0 : 1)) {
        return false;
    }
    std::ranges::copy(socket_, std::begin(address.sun_path));
    if (is_abstract) {
        address.sun_path[0] = '\0';
    }
    const auto length =
        static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket_.size() + (is_abstract ? 0 : 1));

    const int descriptor = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (descriptor < 0) {
        return false;
    }
    const auto sent = ::sendto(descriptor, state.data(), state.size(), MSG_NOSIGNAL,
                               reinterpret_cast<const sockaddr*>(&address), length);
    ::close(descriptor);
    return sent == static_cast<ssize_t>(state.size());
}

bool service_manager::reloading(std::chrono::steady_clock::time_point now) const {
    const auto since = std::chrono::duration_cast<std::chrono::microseconds>(now.time_since_epoch());
    return notify("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(since.count()));
}

namespace {

std::optional<std::int64_t> number(std::string_view text) {
    std::int64_t value = 0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    return failed == std::errc{} && end == text.data() + text.size() && value > 0 ? std::optional{value} : std::nullopt;
}

} // namespace

std::chrono::microseconds watchdog_of(const char* microseconds, const char* process, std::int64_t self) {
    const auto limit = microseconds == nullptr ? std::nullopt : number(microseconds);
    if (!limit || (process != nullptr && number(process) != self)) {
        return {};
    }
    constexpr std::chrono::microseconds longest = std::chrono::hours{24};
    return std::min(longest, std::chrono::microseconds{*limit});
}

} // namespace cles::runtime
