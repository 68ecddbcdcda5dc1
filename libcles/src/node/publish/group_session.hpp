// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>

#include "node/node_state.hpp"
#include "node/publish/bind_requests.hpp"
#include "node/publish/group_bindings.hpp"
#include "node/publish/group_dispatcher.hpp"
#include "node/publish/group_output.hpp"
#include "port/group_source.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <string_view>

namespace cles::core {

/// BIND requests of the group whose handlers have not decided yet.
class pending_group_bindings {
  public:
    static constexpr std::size_t max_pending = 256;

    /// Called for each that is accepted.
    using accepted_callback = std::function<void(const group_source& from, const protocol::request_line& bind)>;
    pending_group_bindings(std::shared_ptr<node_state> host, accepted_callback welcome)
        : node_(std::move(host)), accepted_(std::move(welcome)) {}
    pending_group_bindings(const pending_group_bindings&) = delete;
    pending_group_bindings& operator=(const pending_group_bindings&) = delete;
    ~pending_group_bindings() { clear(); }

    /// Returns false if too many wait. A repeat of one that waits does not count.
    bool ask(const group_source& from, const identity& peer, const protocol::request_line& bind, time_point now);
    /// The binding is no longer wanted.
    void drop(const group_source& from, const protocol::request_line& bind);
    void clear();

  private:
    struct waiting {
        waiting(const group_source& source, identity who, const protocol::request_line& r)
            : from(source), peer(std::move(who)), bind(r) {}
        group_source from;
        identity peer;
        protocol::owned_request bind;
        std::shared_ptr<bind_decision> decision{};
    };
    std::list<waiting>::iterator find(const group_source& from, std::string_view path);

    std::shared_ptr<node_state> node_;
    accepted_callback accepted_;
    std::list<waiting> waiting_;
};

/// Processes what a node receives from its multicast group on one interface (docs/protocol.md, "Multicast"): BIND of
/// `all:` or of a node's name, which it serves on that interface, and updates, which all interfaces process together.
/// Everything else is dropped and counted; nothing is answered.
class group_session {
  public:
    /// `self`: the source of what this node sends through `out`.
    group_session(const std::shared_ptr<node_state>& host, group_dispatcher& dispatcher, const group_source& self,
                  group_output& out, std::uint32_t seed)
        : node_(*host), dispatcher_(dispatcher), bindings_(*host, out, seed),
          pending_bindings_(host, [this](const group_source& from, const protocol::request_line& bind) {
              if (!bindings_.bind(from, bind, node_.time.now())) {
                  ++node_.counts.group_dropped;
              }
          }) {
        dispatcher_.add_own(self);
    }

    /// What others have bound here.
    [[nodiscard]] group_bindings& bindings() noexcept { return bindings_; }
    /// Ends all bindings, including those that wait for a decision.
    void unbind_all() {
        pending_bindings_.clear();
        bindings_.clear();
    }

    /// The message of a datagram; null if it is not valid in a group.
    void on_message(const group_source& from, const protocol::request_line* said, time_point now);

  private:
    bool serve(const group_source& from, const protocol::request_line& request, time_point now);
    bool on_bind(const group_source& from, const protocol::request_line& bind, time_point now);
    bool bind_noun(const group_source& from, const protocol::request_line& bind, time_point now);

    node_state& node_;
    group_dispatcher& dispatcher_;
    group_bindings bindings_;
    pending_group_bindings pending_bindings_;
};

} // namespace cles::core
