// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon_security.hpp"

#include "config/config.hpp"

#ifdef CLES_WITH_SECURITY

#include <cles/error.hpp>
#include <cles/security.hpp>

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <pwd.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

// By name, or by number.
std::optional<std::uint32_t> id_of_user(const std::string& user) {
    std::uint32_t number = 0;
    const auto [end, wrong] = std::from_chars(user.data(), user.data() + user.size(), number);
    if (wrong == std::errc{} && end == user.data() + user.size()) {
        return number;
    }
    constexpr std::size_t enough = 16'384;
    std::vector<char> space(enough);
    passwd entry{};
    passwd* found = nullptr;
    if (::getpwnam_r(user.c_str(), &entry, space.data(), space.size(), &found) != 0 || found == nullptr) {
        return {};
    }
    return entry.pw_uid;
}

} // namespace

std::shared_ptr<detail::security_part> security_of(const config& setup) {
    if (!setup.security.is_on()) {
        return nullptr;
    }
    security_options options{.directory = setup.security.keys};
    for (const auto& [user, member] : setup.security.local_users) {
        const auto id = id_of_user(user);
        if (!id) {
            throw config_error(setup.location_of("security.local_users." + user), "there is no user '" + user + "'");
        }
        options.local_users.emplace(*id, member);
    }
    try {
        return secured(std::move(options));
    } catch (const error& e) {
        throw config_error(setup.location_of("security"), e.message());
    }
}

} // namespace cles::runtime

#else

namespace cles::runtime {

std::shared_ptr<detail::security_part> security_of(const config& setup) {
    if (setup.security.is_on()) {
        throw config_error(setup.location_of("security"), "this clesd was built without security");
    }
    return nullptr;
}

} // namespace cles::runtime

#endif
