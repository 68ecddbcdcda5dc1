// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/security.hpp>

#include "api/linked_security.hpp"
#include "asio/asio_environment.hpp"
#include "node/node_state.hpp"
#include "node/secured/secured_protocol.hpp"
#include "security/secured_node.hpp"
#include "tls/sealed_udp.hpp"
#include "tls/tls_transport.hpp"
#include "transport/transports.hpp"

#include <memory>
#include <utility>

#include <unistd.h>

namespace cles {
namespace {

/// What was made for one service.
struct made_security {
    std::shared_ptr<security::secured_node> node; ///< null: a service has it
    transport::user_names users;
};

void equip(made_security& made, asio_port::asio_environment& environment, core::node_options& node) {
    const auto secured = std::exchange(made.node, nullptr);
    if (!secured) {
        throw error(errc::invalid_option, "the security of a service cannot be used for a second one");
    }
    environment.add_transport("tls",
                              tls::make_tls_transport({.fleet = secured->members(),
                                                       .epoch = protocol::epoch_text(node.epoch),
                                                       .report = [weak = std::weak_ptr{secured}](const auto& refused) {
                                                           if (const auto alive = weak.lock()) {
                                                               alive->log_refused_link(refused);
                                                           }
                                                       }}));
    environment.add_transport("udp", tls::make_sealed_udp(secured->members(), secured->datagrams()));
    environment.add_transport("unix", transport::make_unix(std::move(made.users)));
    node.security = secured;
    node.secured = &core::make_secured_protocol;
}

} // namespace

// The files are read here, so that errors in them are found where the program names their directory.
std::function<void(asio_port::asio_environment&, core::node_options&)> secured(security_options options) try {
    const auto made = std::make_shared<made_security>(
        made_security{std::make_shared<security::secured_node>(options.directory), std::move(options.local_users)});
    made->users.insert_or_assign(0U, made->node->name());
    made->users.insert_or_assign(static_cast<std::uint32_t>(::geteuid()), made->node->name());
    return
        [made](asio_port::asio_environment& environment, core::node_options& node) { equip(*made, environment, node); };
} catch (const security::security_error& e) {
    throw error(errc::denied, e.what());
}

std::function<void(asio_port::asio_environment&, core::node_options&)> secured(const std::string& directory) {
    return secured(security_options{.directory = directory});
}

detail::service_part detail::linked_security(const char* directory) { return secured(std::string{directory}); }

} // namespace cles
