// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/multicast.hpp>

#include "node/base/backoff.hpp"
#include "port/group_port.hpp"

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace cles::core {

/// Decides on which interfaces a node is in its multicast group: compares those that it wants with those that it has
/// joined, after the system has reported a change.
///
/// An interface is left when it does not exist any more, or has another address, from which datagrams have to be sent
/// then. It is not left when it is down or has no link for some time: it works again as it is when that ends.
class group_interfaces {
  public:
    /// Changes come in groups, such as a link and then its address. They are acted on together: this long after the
    /// last of them, or `longest_settling` after the first.
    static constexpr std::chrono::milliseconds settling{200};
    static constexpr std::chrono::milliseconds longest_settling{1'000};
    /// The pauses before what has failed is tried again.
    static constexpr std::chrono::milliseconds first_retry{1'000};
    static constexpr std::chrono::milliseconds longest_retry{60'000};

    explicit group_interfaces(const multicast_options& where);

    /// The interfaces have changed, or may have.
    void on_change(time_point now) noexcept;
    /// When to call `compare`; nothing: after the next change.
    [[nodiscard]] std::optional<time_point> due() const noexcept;

    struct steps {
        std::vector<network_interface> leave; ///< first
        std::vector<network_interface> join;
        std::vector<std::string> left_out; ///< wanted too, but more than a node can join
    };
    /// \param all those that the host has now
    [[nodiscard]] steps compare(const std::vector<network_interface>& all);

    void on_joined(const network_interface& where);
    /// It could not be joined; `again`: that may change without a report. Returns whether this is new.
    bool on_failed(const network_interface& where, bool again, time_point now);
    /// The interfaces could not be listed.
    void on_unlisted(time_point now) { retry(now); }

    [[nodiscard]] const std::vector<network_interface>& joined() const noexcept { return joined_; }

  private:
    [[nodiscard]] std::vector<network_interface> wanted_of(const std::vector<network_interface>& all) const;
    void retry(time_point now);

    bool automatic_;
    std::vector<std::string> names_; // unless it is automatic
    std::vector<network_interface> joined_;
    std::vector<network_interface> failed_;
    std::optional<time_point> changed_at_; // the first change that has not been acted on
    std::optional<time_point> settled_at_;
    std::optional<time_point> retry_at_;
    doubling_pause pause_{first_retry};
};

} // namespace cles::core
