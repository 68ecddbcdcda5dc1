// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/session/connection.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;

/// The endpoints at which a service accepts links.
class listeners {
  public:
    explicit listeners(local_node& host) noexcept : host_(host) {}

    /// Listens at a URL and returns the actual one, with its port. \throws cles::error
    std::string listen(std::string_view where, bool insecure);
    /// Opens the endpoints at which services of the same process and context, this one included, reach it without a
    /// socket.
    void open_local_endpoints();
    void close();
    /// Accepts no more streams from other processes. UDP stays open, so that its sources can be answered.
    void reject();

    /// The endpoint of this service only.
    [[nodiscard]] std::string self_endpoint() const;
    /// The endpoint at which services of this context look for a node of that name.
    [[nodiscard]] std::string shared_endpoint(std::string_view name) const;

  private:
    void start(acceptor& made, bool counted);

    local_node& host_;
    std::vector<std::unique_ptr<acceptor>> open_;
    std::vector<std::unique_ptr<acceptor>> local_acceptors_; // in-process
};

/// All connections of a service: admits them within the limits, owns them, and closes them.
///
/// Sources of datagrams have their own limit: they can be forged, and must not use up the links'.
class connections {
  public:
    /// \pre the local node has its state
    explicit connections(local_node& host) noexcept;

    /// A new link. `counted`: it comes from another process and counts against the limit.
    void on_accepted(link_ptr arrived, bool counted);
    std::shared_ptr<connection> adopt(link_ptr made, connection::origin from);
    /// From now on, requests of other processes are refused, on open and on future connections.
    void refuse_new_requests();
    /// The roster or the rules have changed: closes the connections of those that are no longer members, and those with
    /// bindings that are no longer permitted. States the new roster on the others.
    void on_security_changed();
    /// The connection has ended. Does nothing if it is not there (any more).
    void forget(connection& c, std::uint64_t received, std::uint64_t sent);
    /// Cancels a request that waits for its reply. False if there is none with that id.
    bool cancel(std::uint64_t id);
    [[nodiscard]] std::vector<std::shared_ptr<connection>> all() const;
    /// Finishes a link that is no longer needed, and keeps it until it has closed.
    void close_gracefully(link_ptr parting);
    void on_closed_gracefully(const link& parting);
    /// Closes the links that are closing gracefully.
    void stop();

  private:
    class refused;

    [[nodiscard]] bool has_capacity(const link& arrived);
    void reject(link_ptr arrived);
    void drop_idle_sources();

    local_node& host_;
    std::map<std::uint64_t, std::shared_ptr<connection>> open_; // by number, for a deterministic order
    std::uint64_t last_number_ = 0;
    std::map<const link*, link_ptr> closing_links_;
    link_admission admission_;
    std::size_t sources_ = 0;
};

/// Shuts a service down in order, so that no request and no update is lost (docs/protocol.md, "Leaving"): it starts
/// nothing new, answers what it has started, sends what it has published, announces on each link that it leaves, and
/// waits until the links have ended.
class graceful_shutdown final : private deadline {
  public:
    /// Requests that have not been answered after `limit` are aborted. `done` completes when the links have ended, or
    /// `limits::discard` after their end began, unless `give_up` returns it first.
    graceful_shutdown(local_node& host, std::uint64_t ticket, std::chrono::milliseconds limit,
                      detail::pending_ptr done);
    ~graceful_shutdown() = default;

    /// Call after every event.
    void check();
    /// The operation's ticket while it waits, else 0.
    [[nodiscard]] std::uint64_t ticket() const noexcept { return done_ ? ticket_ : 0; }
    /// Stops and returns the operation; null if it has completed.
    [[nodiscard]] detail::pending_ptr give_up();

  private:
    void on_deadline(time_point now) override;
    void end_links();
    void end();

    local_node& host_;
    std::uint64_t ticket_;
    detail::pending_ptr done_;
    bool looking_ = false;
    bool ending_ = false; // everything that was started has been answered
};

} // namespace cles::core
