// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/tracing/span_recorder.hpp"
#include "port/environment.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

/// Keeps the spans of a node's traced requests: those that have not ended, and for a while the last ones that have.
/// What exceeds its limits is not recorded, or forgotten early.
class span_log final : public span_recorder, public std::enable_shared_from_this<span_log> {
  public:
    static constexpr std::size_t max_open = 1024;
    static constexpr std::size_t max_ended = 2048;
    static constexpr std::chrono::seconds kept_for{60};

    /// \param seed differs between nodes and their incarnations
    span_log(std::string node, const clock& time, std::uint64_t seed)
        : node_(std::move(node)), time_(time), next_id_(seed) {}

    [[nodiscard]] protocol::trace_context receive(const protocol::request_line& r, time_point arrived,
                                                  time_point now) override;
    void add_times(std::uint64_t id, std::chrono::nanoseconds queued, std::chrono::nanoseconds ran) override;
    void end(std::uint64_t id, std::string_view outcome, time_point now) override;
    [[nodiscard]] detail::pending_ptr send(protocol::outgoing_request& r, std::string_view next,
                                           detail::pending_ptr operation, time_point now) override;
    void write(json_writer& w, const protocol::trace_id& id, time_point now) override;

    [[nodiscard]] std::size_t open() const noexcept { return open_.size(); }
    [[nodiscard]] std::size_t ended() const noexcept { return ended_.size(); }

  private:
    class sent_request;

    struct span {
        protocol::trace_id trace{};
        std::uint64_t id = 0;
        std::uint64_t parent = 0;
        bool sent = false; // otherwise received
        cles::verb verb = verb::pull;
        std::string target{}; // as the request names it
        std::string task{};
        std::string next{}; // where it is sent, if it is not the target
        time_point begun{};
        std::chrono::nanoseconds queued{0};
        std::chrono::nanoseconds ran{0};
        time_point over{};
        std::string_view outcome{}; // empty: it has not ended
    };

    protocol::trace_context begin(span what, const protocol::trace_context& parent, time_point now);
    void forget_old(time_point now);
    [[nodiscard]] span* find(std::uint64_t id) noexcept;
    static void write(json_writer& w, const span& s, time_point from);

    const std::string node_;
    const clock& time_;
    std::uint64_t next_id_;
    boost::unordered_flat_map<std::uint64_t, span> open_;
    std::deque<span> ended_; // in the order in which they have
};

} // namespace cles::core
