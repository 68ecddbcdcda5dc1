// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/node_state.hpp"
#include "node/publish/binding.hpp"
#include "port/group_port.hpp"
#include "protocol/request_line.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// What the nodes of the group have bound here through one interface. To a noun's topic it is one subscriber for as
/// long as at least one source has a lease, so each update is sent once on each interface that has subscribers, however
/// many there are.
///
/// Leases of nouns that are not published yet are kept too: the first publication finds its subscribers.
class group_bindings final : private subscriber {
  public:
    /// The minimum time between two repeats of a noun's last update, and the maximum random delay of one.
    static constexpr std::chrono::milliseconds repeat_apart{250};

    group_bindings(node_state& host, group_port& out, std::uint32_t seed);
    ~group_bindings();

    /// Starts, renews or ends a lease. For a source that is new to the noun, the last update is repeated: after a
    /// random delay if every publisher was addressed, at once if only this node was. False if the limit on leases is
    /// reached.
    bool bind(const group_source& from, const protocol::request_line& request, time_point now);
    /// Sends pending updates: the port is writable again.
    void drain(time_point now) { bound_.drain(now); }
    void clear();
    /// The topic is new: those who have bound its noun get its updates.
    void on_opened(topic& made);

  private:
    struct noun final : deadline { // armed to repeat its last update
        noun(group_bindings& all, std::string what) : owner(all), path(std::move(what)) {}
        void on_deadline(time_point now) override { owner.repeat(*this, now); }

        group_bindings& owner;
        std::string path;
        std::size_t leases = 0;
        std::uint64_t repeat_of = 0; // the update to repeat; a later one replaces it
        std::optional<time_point> repeated_at;
    };

    [[nodiscard]] bool has_capacity_for(const group_source& from) const;
    void end(noun& n, const group_source& from);
    void repeat_soon(noun& n, bool delayed, time_point now);
    void repeat(noun& n, time_point now);
    void note_too_large(std::string_view line);

    // subscriber
    [[nodiscard]] bool takes_updates() const override { return out_.unsent() == 0; }
    void put_updates(std::string_view lines) override;

    node_state& node_;
    group_port& out_;
    jitter jitter_;
    link_bindings bound_;
    std::map<std::string, noun, std::less<>> nouns_;
    leases<std::pair<noun*, group_source>> leases_;
    boost::unordered_flat_map<group_source, std::size_t> of_source_; // number of leases
    std::optional<time_point> noted_at_;
};

} // namespace cles::core
