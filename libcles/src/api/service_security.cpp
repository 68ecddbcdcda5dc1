// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/security.hpp>

#include "api/security_part.hpp"
#include "asio/asio_environment.hpp"
#include "node/node_state.hpp"
#include "node/secured/secured_protocol.hpp"
#include "security/secured_node.hpp"
#include "tls/sealed_udp.hpp"
#include "tls/tls_transport.hpp"
#include "transport/transports.hpp"

#include <utility>

#include <unistd.h>

namespace cles {
namespace {

/// The files are read when it is made, so that errors in them are found where the program names their directory.
class service_security final : public detail::security_part {
  public:
    explicit service_security(security_options options)
        : node_(std::make_shared<security::secured_node>(options.directory)),
          local_users_(std::move(options.local_users)) {
        local_users_.insert_or_assign(0U, node_->name());
        local_users_.insert_or_assign(static_cast<std::uint32_t>(::geteuid()), node_->name());
    }

    void equip(asio_port::asio_environment& environment, core::node_options& node) override {
        if (equipped_) {
            throw error(errc::invalid_option, "the security of a service cannot be used for a second one");
        }
        equipped_ = true;
        environment.add_transport(
            "tls", tls::make_tls_transport({.fleet = node_->members(),
                                            .epoch = protocol::epoch_text(node.epoch),
                                            .report = [weak = std::weak_ptr{node_}](std::string_view why) {
                                                if (const auto alive = weak.lock()) {
                                                    alive->log_refused_link(why);
                                                }
                                            }}));
        environment.add_transport("udp", tls::make_sealed_udp(node_->members(), node_->datagrams()));
        environment.add_transport("unix", transport::make_unix(local_users_));
        node.security = node_;
        node.secured = &core::make_secured_protocol;
    }

  private:
    std::shared_ptr<security::secured_node> node_;
    std::map<std::uint32_t, std::string> local_users_;
    bool equipped_ = false;
};

} // namespace

std::shared_ptr<detail::security_part> secured(security_options options) {
    try {
        return std::make_shared<service_security>(std::move(options));
    } catch (const security::security_error& e) {
        throw error(errc::denied, e.what());
    }
}

std::shared_ptr<detail::security_part> secured(const std::string& directory) {
    return secured(security_options{.directory = directory});
}

} // namespace cles
