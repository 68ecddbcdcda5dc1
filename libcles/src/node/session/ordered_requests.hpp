// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/memory_budget.hpp"
#include "node/session/call.hpp"
#include "node/session/line_sink.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The requests of one link that have no id: they run one after another, and are answered in order. The size of those
/// that wait counts against a memory account.
class ordered_requests {
  public:
    using serve_function = std::function<void(const protocol::request_line& request, time_point arrived)>;

    ordered_requests(node_state& host, line_sink& out, std::shared_ptr<memory_account> memory) noexcept
        : node_(host), out_(out), held_(std::move(memory)) {}

    /// Has the request wait for its turn. Returns false if there is no memory for it, unless `always` is set.
    bool push(std::string_view line, time_point arrived, bool always);
    /// The same for the reply to a request that does not run. Equal consecutive ones are stored once, but counted in
    /// full: each of them will be written.
    void push_reply(std::string reply);
    /// Passes those whose turn it is to `run`, but not more than one pass may.
    void serve(const serve_function& run);
    /// Forgets all of them. Returns the call that is running, if any.
    [[gnu::cold]] std::shared_ptr<call> clear() noexcept;

    /// The call that the others wait for; null if there is none.
    [[nodiscard]] const std::shared_ptr<call>& running() const noexcept { return running_; }
    void set_running(std::shared_ptr<call> c) noexcept { running_ = std::move(c); }
    /// Whether a new one has to wait for its turn.
    [[nodiscard]] bool must_wait() const noexcept { return running_ != nullptr || !waiting_.empty(); }
    /// Whether some are ready to run.
    [[nodiscard]] bool has_more() const noexcept { return running_ == nullptr && !waiting_.empty(); }
    [[nodiscard]] bool is_serving() const noexcept { return serving_; }
    [[nodiscard]] std::size_t size() const noexcept { return waiting_.size() + (running_ ? 1 : 0); }
    /// The size of those that wait.
    [[nodiscard]] std::size_t bytes() const noexcept { return held_.size(); }

  private:
    /// Either a request line that is still to be served, or a finished reply that is repeated `times` times.
    struct entry {
        std::string line;
        std::string reply;
        time_point arrived{};
        std::size_t times = 1;
    };

    void update_pause();

    node_state& node_;
    line_sink& out_;
    std::shared_ptr<call> running_;
    std::deque<entry> waiting_;
    memory_reservation held_;
    bool serving_ = false;
    bool paused_ = false; // reading is
};

} // namespace cles::core
