// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/node_state.hpp"
#include "node/publish/topic.hpp"
#include "node/routing/relays.hpp"
#include "node/session/line_sink.hpp"
#include "node/session/reply_writer.hpp"
#include "port/request_origin.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class inbound;

/// Calls the handler for BIND of this noun, if there is one that decides at once. It refuses a binding by an exception.
void ask_bind_handler(const node_state& host, const identity& peer, const protocol::request_line& request);
/// Whether there is one that decides later: a `local_request` asks it.
bool is_bind_decided_later(const node_state& host, const protocol::request_line& request);

/// Serves BIND for one link, and holds the resulting bindings.
class bind_requests {
  public:
    /// Of all nouns of a link together, how many members it may bind them for.
    static constexpr std::size_t max_requesters = 4096;

    bind_requests(std::shared_ptr<node_state> host, line_sink& out, subscriber& updates, const identity& peer,
                  reply_writer& replies);

    void serve(const protocol::request_line& request, time_point due, time_point now, inbound& from);
    /// The same for nouns of other nodes, if this one routes.
    void serve_remote(const protocol::request_line& request, time_point due, time_point now, inbound& from);
    void clear();
    /// Sends pending updates: the link is writable again.
    void drain(time_point now);
    /// The same, also those that `every` would let wait: no others may follow.
    void drain_last(time_point now) { bound_.drain_last(now); }
    /// Whether updates of this node wait to be sent.
    [[nodiscard]] bool is_behind() const noexcept { return bound_.is_behind(); }
    [[nodiscard]] std::size_t size() const noexcept {
        return bound_.size() + (remote_bindings_ ? remote_bindings_->size() : 0);
    }
    [[nodiscard]] bool empty() const noexcept { return size() == 0; }
    /// Whether all requesters may still bind what is bound for them. True without security.
    [[nodiscard]] bool are_permitted() const { return forbidden().empty(); }
    /// Ends the bindings whose requesters may no longer bind them.
    void drop_forbidden();

  private:
    struct asking {
        std::string path;
        std::weak_ptr<call> answers; // a call counts as running until it is destroyed
    };

    /// A binding with a lease.
    struct leased {
        std::string node; ///< empty: this one
        relayed_path path;

        // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the resulting zero for a pointer
        auto operator<=>(const leased&) const = default;
    };

    [[nodiscard]] std::vector<leased> forbidden() const;
    /// Ends a binding and its lease.
    void drop(const leased& which);
    void bind(topic& t, const protocol::request_line& request, std::string_view path, time_point now);
    void serve_later(const protocol::request_line& request, std::string_view path, time_point due, time_point now,
                     inbound& from);
    void withdraw(std::string_view path);
    /// \throws cles::error if a limit is reached
    topic& open(std::string_view path, const protocol::request_line& request);
    [[nodiscard]] bool has_room_for_requester(std::string_view path, const protocol::request_line& request) const;
    void set_lease(const leased& which, const protocol::request_line& request, time_point now);

    std::shared_ptr<node_state> shared_node_;
    node_state& node_;
    const identity& peer_;
    line_sink& out_;
    reply_writer& replies_;
    subscriber& updates_;
    link_bindings bound_;
    std::unique_ptr<relayed_bindings> remote_bindings_; // few links need it
    std::vector<asking> pending_;                       // whose handlers have not decided yet
    // By path, of a secured node. A node that forwards binds a noun once on its link, for several clients.
    std::map<std::string, std::set<owned_origin>, std::less<>> requesters_;
    leases<leased> leases_; // over datagrams: nothing shows that the peer has gone
};

} // namespace cles::core
