// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/leases.hpp"
#include "core/link_bindings.hpp"
#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/relayed_bindings.hpp"
#include "core/reply_writer.hpp"
#include "core/router.hpp"
#include "protocol/message.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Asks the handler for BIND of this noun, if there is one that decides at once; it says by an exception that it will
/// not have this one.
void ask_bind_handler(const node& host, const identity& peer, const protocol::request_line& request);

/// Serves BIND for one link, and holds what has come of it.
class bind_requests {
  public:
    bind_requests(std::shared_ptr<node> host, outlet& out, binder& updates, const identity& peer,
                  reply_writer& replies);

    void serve(const protocol::request_line& request, time_point due, time_point now, call_opener& from);
    /// The same for nouns of other nodes, where this one routes.
    void serve_elsewhere(const protocol::request_line& request, time_point due, time_point now, call_opener& from);
    void clear();
    /// Puts updates that wait to the link, which has room again.
    void drain(time_point now);
    [[nodiscard]] std::size_t size() const noexcept { return bound_.size() + (elsewhere_ ? elsewhere_->size() : 0); }
    [[nodiscard]] bool empty() const noexcept { return size() == 0; }

  private:
    struct asking {
        std::string path;
        std::weak_ptr<call> answers; // which counts what it holds until it goes
    };

    void drop(const std::string& noun);
    void serve_later(const protocol::request_line& request, std::string_view path, time_point due, time_point now,
                     call_opener& from);
    void withdraw(std::string_view path);
    /// \throws cles::error where there is no room
    topic& open(std::string_view path);
    void hold(std::string_view path, std::chrono::milliseconds lease, time_point now);

    std::shared_ptr<node> shared_node_;
    node& node_;
    const identity& peer_;
    outlet& out_;
    reply_writer& replies_;
    binder& updates_;
    link_bindings bound_;
    std::unique_ptr<relayed_bindings> elsewhere_; // few links need it
    std::vector<asking> asking_;                  // whose handlers have not decided yet
    std::optional<leases> leases_;                // where nothing tells that the peer has gone
};

} // namespace cles::core
