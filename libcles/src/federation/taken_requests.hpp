// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/subject.hpp"

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace cles::bridging {

/// The numbers of the last requests of a bridge, which identify those that arrive twice.
class seen_numbers {
  public:
    static constexpr std::size_t window = 4096;

    /// Returns false if it was seen before, or is so old that it may have been.
    bool add(std::uint64_t number) noexcept;

  private:
    std::bitset<window> seen_; // by number modulo the window
    std::uint64_t highest_ = 0;
};

/// The requests of other pools that this bridge has taken, until the node answers them.
class taken_requests {
  public:
    struct request {
        bridge_id by;             ///< without a pool: a program that is no bridge
        std::uint64_t number = 0; ///< by which that bridge knows it
        std::string reply;        ///< the subject for replies
        std::string member{};     ///< the name of that bridge, in a secured fleet
    };

    /// Returns the id for the node's link; nothing if the request has arrived before.
    std::optional<std::uint64_t> add(request taken);
    [[nodiscard]] const request* find(std::uint64_t id) const;
    [[nodiscard]] std::optional<std::uint64_t> id_of(const bridge_id& by, std::uint64_t number) const;
    void remove(std::uint64_t id);

    /// The requests that were added since the last call and are not answered yet: they are to be acknowledged.
    std::vector<const request*> take_unacknowledged();
    /// The requests of that bridge, which is lost.
    [[nodiscard]] std::vector<std::uint64_t> requests_of(const bridge_id& by) const;
    /// The requests that the node has on one link: of a pool's bridges, or in a secured fleet of that member's; of
    /// other programs if `pool` is empty.
    [[nodiscard]] std::vector<std::uint64_t> requests_of(std::string_view pool, std::string_view member) const;
    /// Nothing of that bridge can arrive any more: its numbers are forgotten.
    void forget(const bridge_id& by) { seen_.erase(by); }
    void clear();

    [[nodiscard]] std::size_t size() const noexcept { return taken_.size(); }

  private:
    std::unordered_map<std::uint64_t, request> taken_; // by id
    std::map<std::pair<bridge_id, std::uint64_t>, std::uint64_t> ids_;
    std::map<bridge_id, seen_numbers> seen_;
    std::vector<std::uint64_t> unacknowledged_;
    std::uint64_t last_id_ = 0;
};

} // namespace cles::bridging
