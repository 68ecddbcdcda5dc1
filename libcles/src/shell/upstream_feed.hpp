// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed.hpp>

#include "core/feed_machine.hpp"
#include "core/onward.hpp"
#include "shell/engine.hpp"

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::shell {

/// A noun of another node that is bound for the clients of this one.
class upstream_feed final : public detail::feed_control,
                            private detail::pending_event,
                            public std::enable_shared_from_this<upstream_feed> {
  public:
    /// `ended`: it could not be bound, and is to be let go of.
    upstream_feed(std::shared_ptr<detail::engine> host, std::string node, std::string path, core::feed_events& to,
                  std::function<void()> ended);
    ~upstream_feed() override;

    void begin(std::string_view adverbs);
    void close() override;

  private:
    class first_answer;

    void start(detail::pending_ptr bound) override;
    void next(detail::event_ptr operation) override;
    void cancel_start() override {}
    void cancel(const detail::pending_event*) override {}
    [[nodiscard]] const boost::asio::any_io_executor& executor() const override { return host_->executor(); }

    // What waits for events: this itself, always.
    bool deliver(const detail::raw_event& event) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void discard() noexcept override {}
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

    void wait();
    void on_refused(boost::system::error_code code, std::string_view message);

    std::shared_ptr<detail::engine> host_;
    core::feed_machine machine_;
    core::feed_events* to_; // null: closed
    std::function<void()> ended_;
};

} // namespace cles::shell
