// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/membership/membership.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// The nodes that gossip asks, and those that it may ask or rather does not.

namespace cles::core {

/// A node that is asked for its table.
struct gossip_contact {
    enum class part : std::uint8_t {
        successor, ///< next by name
        chosen,    ///< at random
        bootstrap, ///< until it has sent its whole table
    };
    part as = part::bootstrap;
    std::string node; ///< empty: not known yet
    std::string url;
    time_point next = time_point::min();
    std::string since = "0";
    std::uint64_t ticket = 0; ///< 0: no request is in progress
    time_point sent{};
    time_point until = time_point::max();
    std::optional<std::chrono::nanoseconds> reply_time{}; ///< of the last reply
    std::string describe{};                               ///< epochs to describe, separated by commas
    std::size_t table_bytes = 0;                          ///< size of a table that is always sent whole
    std::size_t among = 0;                                ///< number of known nodes when it was chosen
    unsigned failures = 0;                                ///< in a row
    bool own_entry_sent = false;
    bool ended = false;
};

/// The nodes that are asked, and those that failed recently.
class gossip_contacts {
  public:
    using contact = gossip_contact;
    using part = gossip_contact::part;

    contact& add(part as, std::string_view node, std::string_view url, time_point now) {
        return all_.emplace_back(contact{as, std::string{node}, std::string{url}, now});
    }
    [[nodiscard]] contact* find_ticket(std::uint64_t ticket) noexcept;
    [[nodiscard]] contact* find_node(std::string_view node) noexcept;
    [[nodiscard]] contact* find(part as) noexcept;
    [[nodiscard]] std::size_t count(part as) const noexcept;

    /// Excludes `node` from selection until then.
    void rest(std::string_view node, time_point until);
    [[nodiscard]] bool rests(std::string_view node, time_point now) const noexcept;
    void expire_resting(time_point now);

    /// Removes the contacts that have ended; \returns those at whose URLs no other contact is asked. `by_name`: nodes
    /// at the same URL are told apart.
    std::vector<contact> take_ended(bool by_name = false);
    void clear() noexcept { all_.clear(); }

    [[nodiscard]] auto begin() noexcept { return all_.begin(); }
    [[nodiscard]] auto end() noexcept { return all_.end(); }
    [[nodiscard]] auto begin() const noexcept { return all_.begin(); }
    [[nodiscard]] auto end() const noexcept { return all_.end(); }

  private:
    struct resting {
        std::string node;
        time_point until{};
    };

    std::vector<contact> all_;
    std::vector<resting> resting_;
};

/// Nodes that do not gossip but announce themselves to a group received here: asking them yields nothing new.
class announce_only_nodes {
  public:
    static constexpr int recheck_intervals = 60; ///< until a node is checked again

    /// Returns true if `node` is one of them, and is not to be asked until `until`.
    bool add(const membership& others, std::string_view node, time_point until, time_point now);
    [[nodiscard]] bool contain(const membership::member& k, time_point now) const;
    /// The number of other nodes that may be asked.
    [[nodiscard]] std::size_t count_gossiping(const membership& others, time_point now) const;

  private:
    struct entry {
        std::uint32_t epoch = 0;
        time_point until{};
    };
    std::map<std::string, entry, std::less<>> all_;
};

/// Nodes that were removed without having left, with their URLs. They are tried from time to time, so that the parts of
/// a network that was cut in two find each other again.
class lost_nodes {
  public:
    static constexpr std::chrono::hours remembered{1};

    struct node {
        std::string name;
        std::string url;
        time_point until{};
    };

    lost_nodes(std::size_t most, std::uint32_t seed) noexcept : max_entries_(most), jitter_(seed) {}

    void add(std::string_view name, std::string_view url, time_point now);
    /// A random one of them and of the suspect nodes.
    std::optional<node> any(const membership& others, time_point now);

  private:
    std::size_t max_entries_;
    jitter jitter_;
    std::vector<node> lost_;
};

/// The configured addresses that a node asks first, and again while no node that replied there is live.
class seeds {
  public:
    static constexpr std::chrono::milliseconds first_pause{250};
    static constexpr std::chrono::milliseconds min_rest{2'000}; ///< the longest pause, in a small network

    explicit seeds(std::uint32_t chance) noexcept : jitter_(chance) {}

    /// URLs that remain keep their state. New ones are due at once.
    void set(const std::vector<std::string>& urls);
    [[nodiscard]] bool empty() const noexcept { return all_.empty(); }
    /// A seed to ask now. It is due again after a pause of at most `rest`.
    std::optional<std::string> due(const membership& others, time_point now, std::chrono::milliseconds rest);
    /// When the next seed is due, unless a node is found before.
    [[nodiscard]] std::optional<time_point> next() const noexcept;
    /// `node` replied at `url`.
    void on_answer(std::string_view url, std::string_view node);
    /// `url` leads to this node itself.
    void on_self(std::string_view url);
    /// The seed has answered or refused. Returns whether it was the last that had not.
    bool on_heard(std::string_view url);
    [[nodiscard]] bool all_heard() const;
    /// Has the nodes that replied be reached at the URLs where they did, if they have announced these. It may have
    /// become known only later which they have announced, and the first one may lead nowhere from here.
    void prefer_in(membership& others) const;

  private:
    struct seed {
        std::string url;
        std::string node{}; // that replied there
        bool self = false;
        bool heard = false;
        doubling_pause pause{first_pause};
        time_point next = time_point::min();
    };

    std::vector<seed> all_;
    jitter jitter_;
};

} // namespace cles::core
