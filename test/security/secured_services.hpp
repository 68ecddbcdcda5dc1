// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security.hpp>
#include <cles/service.hpp>

#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/key_directory.hpp"
#include "security/fleet_fixture.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>

#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::security::test {

/// A fleet of services in this process, each with a directory of its own.
class secured_fleet {
  public:
    explicit secured_fleet(std::initializer_list<std::string> names) {
        for (const auto& name : names) {
            add(name);
        }
    }

    /// The newest roster is only written to the directories of the nodes that are added.
    void add(const std::string& name, const member_rights& rights = {}) {
        const auto directory = key_directory::create(directory_of(name));
        const auto key = directory.create_key(name);
        authority.add(key.public_part(), rights);
        for (const auto& member : authority.newest().members()) {
            if (member.name == name || with_newest) {
                key_directory{directory_of(member.name)}.store_roster(authority.newest());
            }
        }
    }
    [[nodiscard]] std::string directory_of(const std::string& name) const { return (folder_ / name).string(); }

    /// Options of a node that listens at a free port.
    [[nodiscard]] service_options options(std::string name) const {
        service_options made{.name = std::move(name)};
        made.listen = {"tls://127.0.0.1:0"};
        made.security = secured(directory_of(made.name));
        return made;
    }
    /// The same for one that knows another.
    [[nodiscard]] service_options knowing(std::string name, const service& other) const {
        auto made = options(std::move(name));
        made.peers.emplace(other.name(), other.endpoints().front());
        return made;
    }

    fleet_authority authority = fleet_authority::found(signing_key::generate());
    bool with_newest = true; ///< all nodes get the roster with which one is added

  private:
    own_folder folder_;
};

/// The outcome of a request: "{...}", or "denied: ...".
inline std::string ask(boost::asio::io_context& io, service& by, const std::string& command) {
    std::optional<std::string> found;
    std::string why;
    by.async_request(command, call_options{}.diagnostics(why),
                     [&](boost::system::error_code code, const json_text& reply) {
                         found = code ? code.message() + ": " + why : reply.text;
                     });
    cles::test::run_until(io, [&] { return found.has_value(); });
    return *found;
}

} // namespace cles::security::test
