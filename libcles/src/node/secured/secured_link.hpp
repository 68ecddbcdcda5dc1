// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/peer_reply.hpp"
#include "node/node_state.hpp"
#include "node/secured/confirmed_epochs.hpp"
#include "node/secured/unconfirmed_updates.hpp"
#include "node/security_protocol.hpp"
#include "node/session/line_sink.hpp"
#include "node/session/outbound.hpp"

#include <memory>
#include <string>

namespace cles::core {

/// The rosters and updates on one link of a secured node.
class secured_link final : public link_security {
  public:
    secured_link(std::shared_ptr<node_state> host, confirmed_epochs& confirmed, line_sink& out, outbound& asking,
                 const identity& peer, unconfirmed_updates::deliver_function deliver);

    bool serve(const protocol::request_line& request, time_point now) override;
    bool admits(const protocol::request_line& update) override;
    void ask(const std::string& publisher, time_point due, peer_reply::function then) override;
    void send_hello() override;

  private:
    /// Counts and logs an update that is dropped.
    void refuse(const std::string& why);

    std::shared_ptr<node_state> node_;
    confirmed_epochs& confirmed_;
    line_sink& out_;
    outbound& asking_;
    const identity& peer_;
    std::shared_ptr<unconfirmed_updates> unconfirmed_;
};

} // namespace cles::core
