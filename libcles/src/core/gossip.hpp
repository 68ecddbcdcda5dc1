// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/counters.hpp"
#include "core/deadlines.hpp"
#include "core/gossip_answers.hpp"
#include "core/gossip_contacts.hpp"
#include "core/jitter.hpp"
#include "core/lost_nodes.hpp"
#include "core/peer_table.hpp"
#include "core/plain_nodes.hpp"
#include "core/presence.hpp"
#include "core/seeds.hpp"
#include "core/teller.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Whom a node asks for their tables, and when (docs/protocol.md, "Gossip"): the next one by name, so that everybody is
/// asked by somebody; two at random, so that news travels in few steps; and now and then one who is known no more.
class gossip final : public gossip_answers, private deadline {
  public:
    /// Carries out what is decided. What comes of a ticket is told by `on_answer`, `on_description` or `on_failure`,
    /// never from inside the call.
    class caller {
      public:
        caller() = default;
        caller(const caller&) = delete;
        caller& operator=(const caller&) = delete;
        /// `PULL self:cles/peers since=... describe=...` at that URL, the latter where it is not empty.
        virtual void ask(std::uint64_t ticket, std::string_view url, std::string_view since,
                         std::string_view describe) = 0;
        /// `PULL self:cles` there.
        virtual void ask_who(std::uint64_t ticket, std::string_view url) = 0;
        /// `PUSH self:cles/peers` there, of whose outcome nothing is told.
        virtual void tell(std::string_view url, std::string_view table) = 0;
        /// Nobody is asked there for a while.
        virtual void release(std::string_view url) = 0;

      protected:
        ~caller() = default;
    };

    static constexpr std::size_t at_random = 2;              ///< how many are asked that chance has chosen
    static constexpr std::chrono::milliseconds limit{2'000}; ///< for an answer
    static constexpr unsigned most_failures = 2;             ///< in a row, until another one is asked
    static constexpr int turns_per_interval = 8;
    static constexpr int turns_among_few = 4;           ///< where all others are asked
    static constexpr int intervals_of_rest = 2;         ///< for one that failed
    static constexpr int intervals_of_stay = 30;        ///< of one that chance has chosen
    static constexpr std::size_t bytes_a_second = 4096; ///< of tables that come whole each time

    struct self {
        std::string name;
        std::string epoch; ///< as text
    };

    gossip(self who, caller& out, presence& others, counters& counts, deadline_queue& deadlines, std::size_t most,
           std::uint32_t seed);

    void start(time_point now);
    /// Tells those who are asked that this node leaves, where it has announced itself. It goes on asking.
    void leave(time_point now);
    /// Leaves, and asks nobody any more.
    void stop(time_point now);
    void set_seeds(const std::vector<std::string>& urls, time_point now);

    void on_answer(std::uint64_t ticket, std::string_view json, time_point now);
    void on_description(std::uint64_t ticket, std::string_view json, time_point now);
    void on_failure(std::uint64_t ticket, time_point now);

    void write_news(json_writer& w, const table_question& asked, std::size_t longest, time_point now) override;
    bool on_told(std::string_view json, const teller& by, time_point now) override;
    /// A node has gone without a word.
    void on_gone(std::string_view node, std::string_view where, time_point now);

    /// Who is asked in turn, for those who look on.
    [[nodiscard]] std::vector<std::string> asked() const;

  private:
    using contact = gossip_contact;
    using part = gossip_contact::part;

    void on_deadline(time_point now) override;
    void review(time_point now);
    void drop_lost_causes(time_point now);
    void choose_successor(time_point now);
    void choose_at_random(time_point now);
    void invite_guests(time_point now);
    void call(contact& c, time_point now);
    void tell_own(contact& c, time_point now);
    void tell_if_nobody_asks(time_point now);
    void put_off(contact& c, time_point now);
    void end(contact& c, bool rests, time_point now);
    void sweep();
    void follow(time_point now);

    [[nodiscard]] std::chrono::milliseconds interval() const noexcept;
    [[nodiscard]] std::chrono::milliseconds search_pause() const noexcept;
    [[nodiscard]] std::chrono::milliseconds until_next_search() noexcept;

    const self self_;
    caller& out_;
    presence& others_;
    counters& counts_;
    deadline_queue& deadlines_;
    jitter jitter_;
    seeds seeds_;
    lost_nodes lost_;
    gossip_contacts contacts_;
    plain_nodes plain_;
    std::optional<std::string> stranger_; // who told of itself, and is to be asked
    time_point next_search_{};
    time_point next_successor_ = time_point::min();
    time_point last_asked_{};
    std::uint64_t last_ticket_ = 0;
    bool started_ = false;
    bool left_ = false;
};

} // namespace cles::core
