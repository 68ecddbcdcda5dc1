// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;

/// The other pools that a node reaches (docs/federation.md). An interface, so that programs without federation do not
/// link its code.
class other_pools {
  public:
    other_pools() = default;
    other_pools(const other_pools&) = delete;
    other_pools& operator=(const other_pools&) = delete;
    virtual ~other_pools() = default;

    /// The node listens now. Called once. \throws cles::error
    virtual void start(local_node& host) = 0;
    /// The URL of the pool that has this node, which is not known at home. Empty if none has.
    [[nodiscard]] virtual std::string address_of(std::string_view target) const = 0;
    /// The roster or the rights have changed, in a secured fleet.
    virtual void on_security_changed() = 0;
    /// Once the node has stopped listening: whether what others have sent has been answered. Then it calls
    /// `local_node::check_shutdown`.
    [[nodiscard]] virtual bool has_left() const = 0;

    struct known_pool {
        std::string name;
        bool live = true; ///< requests can be sent there now
    };
    /// All other pools that are known, by name.
    [[nodiscard]] virtual std::vector<known_pool> list() const = 0;
};

} // namespace cles::core
