// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/membership/incarnation.hpp"

#include <boost/system/error_code.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The outcome of asking an incarnation whether it is alive.
struct probe_outcome {
    enum class kind : std::uint8_t {
        answered, ///< by the node that the members below describe
        absent,   ///< refused, or no reply in time
        unclear,  ///< an error reply or an unreadable one, or this node could not ask
    };
    kind what = kind::unclear;
    std::string node{};
    std::uint32_t epoch = 0;
    std::chrono::milliseconds uptime{0};
};

/// Reads the reply to `PULL self:cles`; if it cannot be read, the outcome is unclear.
probe_outcome read_probe_answer(std::string_view json);
/// The outcome of a probe that failed without a reply.
probe_outcome failed_probe(boost::system::error_code code);

/// The progress in finding out which of two incarnations of one name is alive.
struct name_check {
    enum class stage : std::uint8_t { none, owner, contender, over };
    stage at = stage::none;
    std::uint64_t ticket = 0;
    time_point asked{};
    time_point owner_began{};
};

/// Another incarnation (the contender) under a name that is taken, or the same one at another address.
struct name_conflict {
    incarnation contender;
    time_point first_seen{};       ///< the contender
    bool owner_seen_since = false; ///< the owner was received after the contender
    bool is_reported = false;      ///< both are live
    name_check check{};
};

/// Probes the incarnations of a contested name, and decides from the outcomes which of them is the owner. Limits the
/// probes, because any host that can send to the group can trigger them.
class name_conflicts {
  public:
    /// Asks an incarnation whether it is alive, by `PULL self:cles` at `url` within `probe_limit`. The outcome is
    /// reported to `membership::on_probed`, never from inside the call.
    using prober = std::function<void(std::uint64_t ticket, std::string_view url)>;

    static constexpr std::chrono::milliseconds probe_limit{500};
    /// Of two nodes that start within it, neither was first.
    static constexpr std::chrono::milliseconds same_start_tolerance{1'000};
    static constexpr std::chrono::milliseconds probe_interval{50}; ///< average time between probes
    static constexpr std::chrono::milliseconds probe_burst{1'600};

    /// What follows from the outcome of a probe.
    enum class action : std::uint8_t {
        none,
        owner_gone,      ///< the name passes to the contender
        owner_stays,     ///< both are live, and the owner keeps the name
        contender_first, ///< both are live, and the name belongs to the contender
        owner_moved,     ///< the contender is the owner, at another address
    };

    /// The owner of a name, as it is known here.
    struct known_owner {
        const std::string& name;
        std::uint32_t epoch;
        time_point since;      ///< when it became known
        time_point resumed_at; ///< when this node was last suspended
    };

    void set_prober(prober by) noexcept { prober_ = std::move(by); }
    /// This node has started.
    void begin(time_point now) noexcept { started_at_ = now; }

    /// The contender of `name` was received: probes the owner, once. If the contender is the owner at another address,
    /// and the owner does not answer at the old one, it is probed there.
    void check_owner(const std::string& name, const incarnation& owner, name_conflict& conflict, time_point now);
    /// The owner of `name` was received from a new source, by a newer announcement: probes it there, at `where`.
    void check_new_source(const std::string& name, name_conflict& conflict, std::string_view where, time_point now);
    /// The contender of this node's own name was received: probes it, once. The owner is live.
    void check_own_name(const std::string& name, name_conflict& conflict, time_point now);
    /// The name for which that probe was sent; empty if the ticket is unknown.
    [[nodiscard]] std::string_view probed_name(std::uint64_t ticket) const noexcept;
    /// The name for which that probe was sent, once; nothing if the ticket is unknown.
    std::optional<std::string> take_probe(std::uint64_t ticket);
    /// The outcome of the last probe for `conflict`.
    action on_probed(const known_owner& owner, name_conflict& conflict, const probe_outcome& found, time_point now);

  private:
    /// Probes, unless there are too many probes or there is no usable address.
    void probe(name_check& check, name_check::stage stage, const std::string& name, std::string_view where,
               time_point now);

    prober prober_;
    std::map<std::uint64_t, std::string> probes_; // in progress: the name by ticket
    std::uint64_t last_probe_ = 0;
    time_point probe_debt_{};
    time_point started_at_{};
};

} // namespace cles::core
