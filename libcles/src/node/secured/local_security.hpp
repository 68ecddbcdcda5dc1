// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/base/deadlines.hpp"
#include "port/node_security.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;

/// Connects a running node with its security: has the links and bindings closed that are no longer permitted, asks
/// other nodes for newer rosters, and calls it when it is due.
class local_security final : private security_observer, private deadline {
  public:
    /// \pre the node is secured \throws cles::error if the node's name is not that of its key
    explicit local_security(local_node& host);
    local_security(const local_security&) = delete;
    local_security& operator=(const local_security&) = delete;
    ~local_security();

    /// Asks that node for its roster, if it is wanted.
    void ask_for_roster(std::string_view node, std::uint32_t version, time_point now);
    /// Opens a link to that node at its address for TLS, if one is known, and closes it when it is idle.
    void visit(std::string_view node);

  private:
    // security_observer
    void on_security_changed() override;
    void on_stated_roster(std::string_view name, std::uint32_t version) override;
    void on_unanswered(std::string_view name, const std::vector<std::string>& endpoints) override;
    void on_due(time_point at) override;
    void on_security_log(log_level level, std::string text) override;
    // deadline
    void on_deadline(time_point now) override;

    void apply_change();
    void pull_roster(std::string_view node, std::string_view at, detail::pending_ptr reply);
    void visit(std::string_view node, const std::string& url);

    local_node& host_;
    bool removed_ = false; ///< as logged
};

} // namespace cles::core
