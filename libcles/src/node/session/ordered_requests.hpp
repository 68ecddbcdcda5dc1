// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/memory_budget.hpp"
#include "node/node_state.hpp"
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

/// Requests without an id that wait for an earlier one, in order of arrival. Their size counts against a memory
/// account.
class waiting_requests {
  public:
    explicit waiting_requests(std::shared_ptr<memory_account> memory = nullptr) noexcept : held_(std::move(memory)) {}

    /// Either a request line that is still to be served, or a finished reply that is repeated `times` times.
    struct entry {
        std::string line;
        std::string reply;
        time_point arrived;
        std::size_t times = 1;
    };

    /// Returns false if there is no memory for the line, unless `always` is set.
    bool push_line(std::string_view line, time_point arrived, bool always = false) {
        if (!always && !held_.try_resize(bytes_ + line.size())) {
            return false;
        }
        grow(line.size());
        entries_.push_back({.line = std::string{line}, .reply = {}, .arrived = arrived});
        return true;
    }
    /// Equal consecutive replies are stored once, but counted in full: each of them will be written.
    void push_reply(std::string reply, time_point arrived) {
        grow(reply.size());
        if (!entries_.empty() && entries_.back().line.empty() && entries_.back().reply == reply) {
            ++entries_.back().times;
            return;
        }
        entries_.push_back({.line = {}, .reply = std::move(reply), .arrived = arrived});
    }
    entry pop() {
        auto first = std::move(entries_.front());
        entries_.pop_front();
        bytes_ -= first.line.size() + first.reply.size() * first.times;
        held_.resize(bytes_);
        return first;
    }
    void clear() noexcept {
        entries_.clear();
        bytes_ = 0;
        held_.resize(0);
    }

    [[nodiscard]] bool empty() const noexcept { return entries_.empty(); }
    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
    [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

  private:
    void grow(std::size_t by) noexcept {
        bytes_ += by;
        held_.resize(bytes_);
    }

    std::deque<entry> entries_;
    std::size_t bytes_ = 0;
    memory_reservation held_;
};

/// The requests of one link that have no id: they run one after another, and are answered in order.
class ordered_requests {
  public:
    using serve_function = std::function<void(const protocol::request_line& request, time_point arrived)>;

    ordered_requests(node_state& host, line_sink& out, std::shared_ptr<memory_account> memory) noexcept
        : node_(host), out_(out), waiting_(std::move(memory)) {}

    /// Has the request wait for its turn. Returns false if there is no memory for it, unless `always` is set.
    bool push(std::string_view line, time_point now, bool always);
    /// The same for the reply to a request that does not run.
    void push_reply(std::string reply, time_point now);
    /// Passes those whose turn it is to `run`, but not more than one pass may.
    void serve(const serve_function& run);
    /// Forgets all of them. Returns the call that is running, if any.
    std::shared_ptr<call> clear() noexcept;

    /// The call that the others wait for; null if there is none.
    [[nodiscard]] const std::shared_ptr<call>& running() const noexcept { return running_; }
    void set_running(std::shared_ptr<call> c) noexcept { running_ = std::move(c); }
    /// Whether a new one has to wait for its turn.
    [[nodiscard]] bool must_wait() const noexcept { return running_ != nullptr || !waiting_.empty(); }
    /// Whether some are ready to run.
    [[nodiscard]] bool has_more() const noexcept { return running_ == nullptr && !waiting_.empty(); }
    [[nodiscard]] bool is_serving() const noexcept { return serving_; }
    [[nodiscard]] std::size_t size() const noexcept { return waiting_.size() + (running_ ? 1 : 0); }

  private:
    void update_pause();

    node_state& node_;
    line_sink& out_;
    std::shared_ptr<call> running_;
    waiting_requests waiting_;
    bool serving_ = false;
    bool paused_ = false; // reading is
};

} // namespace cles::core
