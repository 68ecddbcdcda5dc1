// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/pending.hpp>

#include "core/feed_machine.hpp"
#include "core/onward.hpp"
#include "shell/local_node.hpp"

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::shell {

/// A noun of another node that is bound for the clients of this one.
class upstream_feed final : private detail::pending_event, public std::enable_shared_from_this<upstream_feed> {
  public:
    /// `ended`: it could not be bound, and is to be let go of.
    upstream_feed(std::shared_ptr<local_node> host, std::string node, std::string path, core::feed_events& to,
                  std::function<void()> ended);
    ~upstream_feed();

    void begin(std::string_view adverbs);
    void close();

  private:
    class first_answer;

    // What waits for events: this itself, always.
    bool deliver(const detail::raw_event& event) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void discard() noexcept override {}
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

    void wait();
    void on_refused(boost::system::error_code code, std::string_view message);

    std::shared_ptr<local_node> host_;
    core::feed_machine machine_;
    core::feed_events* to_; // null: closed
    std::function<void()> ended_;
};

} // namespace cles::shell
