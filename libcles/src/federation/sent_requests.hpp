// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge_link.hpp"
#include "federation/subject.hpp"
#include "protocol/reply_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace cles::bridging {

/// Receives what becomes of requests that were sent to other pools.
class sent_requests_events {
  public:
    sent_requests_events() = default;
    sent_requests_events(const sent_requests_events&) = delete;
    sent_requests_events& operator=(const sent_requests_events&) = delete;

    /// A reply for the node's request `id` on that link, without id.
    /// \param taker the bridge that has answered; empty if it is not known
    virtual void on_answer(const bridge_link& on, std::uint64_t id, std::string_view reply, std::string_view taker) = 0;
    /// That bridge is to cancel the request.
    virtual void cancel_at(const bridge_id& taker, std::uint64_t number) = 0;
    /// The node's request was not answered until long after its deadline.
    virtual void on_forgotten(std::uint64_t id) = 0;

  protected:
    ~sent_requests_events() = default;
};

/// The requests of this node to other pools, from when they are published until they are answered.
class sent_requests {
  public:
    static constexpr std::chrono::seconds acknowledged_within{2};

    explicit sent_requests(sent_requests_events& events) noexcept : events_(events) {}

    /// Returns the number by which the pool answers. \param due the deadline, which both ends know
    /// \param addressee the bridge to which it is sent; empty: the one that NATS selects
    std::uint64_t add(const bridge_link& from, std::uint64_t id, time_point due, time_point now,
                      std::string addressee = {});
    /// It was not published.
    void refuse(std::uint64_t number, const protocol::failure& why);
    /// A message for that number from the pool.
    void on_message(std::uint64_t number, std::string_view message, time_point now);
    /// The pool has answered, but the message cannot be passed on: the request fails.
    void on_unusable(std::uint64_t number, std::string_view message, time_point now, const protocol::failure& why);
    /// The node has cancelled it. A bridge that has not acknowledged it yet is told when it does.
    void cancel(std::uint64_t id);
    /// What that bridge took, or was sent alone, is not answered any more.
    void on_lost(const bridge_id& taker, std::string_view why);
    void on_time(time_point now);
    /// The node has closed the link: nobody waits.
    void close(const bridge_link& link);
    /// The same of all links to that pool.
    void close_pool(std::string_view pool);
    /// The connection is lost. Nothing is reported.
    void clear();

    /// The deadline to state to all nodes of a pool, if their results are needed within `left_ms`. The pool waits for
    /// all until then, counted from when the request arrives. So time for the way is left: what acknowledgements of the
    /// pool have lately taken at most, but at least a quarter or a second. A quarter remains for the nodes.
    [[nodiscard]] std::uint32_t deadline_of_all(std::string_view pool, std::uint32_t left_ms) const;

    [[nodiscard]] std::size_t size() const noexcept { return sent_.size(); }

  private:
    struct request {
        bridge_link from;
        std::uint64_t id = 0;
        std::string taker{}; ///< its instance; empty: not acknowledged yet
        std::string addressee{};
        time_point sent_at;
        time_point forgotten_at; ///< for lack of a reply
        bool is_cancelled = false;
    };
    using requests = std::unordered_map<std::uint64_t, request>;

    void on_taken(requests::iterator which, std::string_view taker, time_point now);
    void note_round_trip(const std::string& pool, time_point::duration took);
    requests::iterator erase(requests::iterator which);
    void fail(requests::iterator which, const protocol::failure& why);
    void fail_unacknowledged(requests::iterator which, std::string why);
    template <class Condition>
    void cancel_if(Condition concerns);

    sent_requests_events& events_;
    requests sent_;                                                        // by number
    std::unordered_map<std::uint64_t, std::uint64_t> numbers_;             // by id
    std::map<std::string, time_point::duration, std::less<>> round_trips_; // by pool
    std::uint64_t last_ = 0;
};

/// "taken=0b1c2d3e4f5a6b7c", which precedes a reply, or is an acknowledgement. Removes it from `message`.
std::string_view take_taker(std::string_view& message) noexcept;
std::string taken_text(std::string_view instance);

} // namespace cles::bridging
