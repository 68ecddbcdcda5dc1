// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/node_state.hpp"
#include "node/publish/bind_requests.hpp"
#include "node/publish/group_bindings.hpp"
#include "node/routing/subrequest.hpp"
#include "port/group_port.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace cles::core {

class multicast_group;

/// Processes what a node receives from its multicast group on one interface (docs/protocol.md, "Multicast"): BIND of
/// `all:` or of a node's name, which it serves on that interface, and updates, which all interfaces process together.
/// Everything else is dropped and counted; nothing is answered.
class group_session final : public group_listener {
  public:
    /// How many BIND requests may wait for the decision of their handlers.
    static constexpr std::size_t max_pending = 256;

    group_session(std::shared_ptr<node_state> host, multicast_group& group, std::shared_ptr<group_port> port,
                  std::uint32_t seed);
    group_session(const group_session&) = delete;
    group_session& operator=(const group_session&) = delete;
    ~group_session();

    /// Starts to receive. Call once.
    void start() { port_->start(*this); }
    /// Ends all bindings, including those that wait for a decision, and leaves the group. Idempotent.
    void stop();
    /// What others have bound here.
    [[nodiscard]] group_bindings& bindings() noexcept { return bindings_; }

    void on_datagram(const group_datagram& datagram) override;
    void on_writable() override;

  private:
    struct waiting {
        waiting(identity who, const protocol::request_line& r) : peer(std::move(who)), bind(r) {}
        identity peer;
        protocol::owned_request bind;
        std::shared_ptr<local_request> handler{};
    };

    bool serve(const group_datagram& datagram, time_point now);
    bool on_bind(const group_datagram& datagram, const protocol::request_line& bind, time_point now);
    bool bind_noun(const group_datagram& datagram, const protocol::request_line& bind, time_point now);
    bool ask(const group_source& from, const identity& peer, const protocol::request_line& bind, time_point now);
    void withdraw(const group_source& from, const protocol::request_line& bind);

    std::shared_ptr<node_state> node_;
    multicast_group& group_;
    std::shared_ptr<group_port> port_;
    group_bindings bindings_;
    /// BIND requests whose handlers have not decided yet, by source and path.
    std::map<std::pair<group_source, std::string>, waiting> waiting_;
};

} // namespace cles::core
