// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/feed_mailbox.hpp"
#include "core/publisher_orders.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <string>
#include <string_view>

namespace cles::core {

/// A feed that is bound by the multicast group: to one node's noun, or to that of all who publish it. What is new, old
/// or missing is told for each publisher apart. Where there are more of them than it tells apart, the one that has been
/// silent for longest is forgotten.
class group_feed {
  public:
    /// `target`: a node's name, or "all".
    group_feed(const limits& bounds, completion_queue& completions, std::string target, std::string path)
        : target_(std::move(target)), path_(std::move(path)), mail_(bounds, completions),
          publishers_(bounds.publishers) {}
    group_feed(const group_feed&) = delete;
    group_feed& operator=(const group_feed&) = delete;

    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] bool wants(std::string_view node) const noexcept { return target_ == "all" || target_ == node; }
    /// Hands an update on that it wants. False where it is old or repeated, or its body is not JSON.
    /// The next update of that node is the first.
    void forget(std::string_view node) { publishers_.forget(node); }
    bool take(const protocol::request_line& update, feed_mailbox::hand_over when = feed_mailbox::hand_over::now);
    [[nodiscard]] feed_mailbox& mail() noexcept { return mail_; }
    [[nodiscard]] std::size_t publishers() const noexcept { return publishers_.size(); }

  private:
    std::string target_;
    std::string path_;
    feed_mailbox mail_;
    publisher_orders publishers_;
};

} // namespace cles::core
