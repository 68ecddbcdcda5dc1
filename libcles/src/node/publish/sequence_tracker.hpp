// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "protocol/request_line.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// Determines from `seq` and `epoch` which updates of a noun are new to a subscriber, and how many it has missed.
class sequence_tracker {
  public:
    struct verdict {
        bool is_new = false;      ///< false: old or repeated
        bool restarted = false;   ///< the publisher has a new incarnation
        std::uint64_t missed = 0; ///< updates between the last one and this one
    };

    verdict take(std::uint32_t epoch, std::uint64_t seq) noexcept {
        if (epoch_ == epoch) {
            if (seq <= seq_) {
                return {};
            }
            const auto missed = seq - seq_ - 1;
            seq_ = seq;
            return {.is_new = true, .missed = missed};
        }
        if (std::find(previous_epochs_.begin(), previous_epochs_.end(), std::optional{epoch}) !=
            previous_epochs_.end()) {
            return {};
        }
        const bool restarted = epoch_.has_value();
        if (restarted) {
            previous_epochs_[next_previous_++ % previous_epochs_.size()] = epoch_;
        }
        epoch_ = epoch;
        seq_ = seq;
        return {.is_new = true, .restarted = restarted};
    }

    /// An update, as a subscriber receives it.
    struct arrival {
        bool is_new = false;                    ///< false: old or repeated, or not JSON after a gap
        std::optional<detail::raw_event> gap{}; ///< comes before the update
        detail::raw_event event{};              ///< the update, if it is new
    };

    /// Whether an update is new, and the gap that it shows unless it is `thinned`. If its body turns out not to be
    /// JSON, set the tracker back to what it was before: then a later update shows that this one is missing.
    arrival accept(const protocol::request_line& update, bool thinned) {
        const auto before = *this;
        const auto found = take(*update.epoch, *update.seq);
        if (!found.is_new) {
            return {};
        }
        arrival result{.is_new = true,
                       .event = {.body = update.body.empty() ? std::string_view{"{}"} : update.body,
                                 .publisher = update.noun.target,
                                 .seq = *update.seq,
                                 .line = update.text,
                                 .reading = update.reading}};
        if (found.missed != 0 && !thinned) {
            result.event.checked = result.event.has_json();
            if (!result.event.checked) {
                *this = before;
                return {};
            }
            result.gap = detail::raw_event{
                .kind = feed_event::gap, .publisher = update.noun.target, .seq = *update.seq, .missed = found.missed};
        }
        return result;
    }

  private:
    std::optional<std::uint32_t> epoch_;
    std::uint64_t seq_ = 0;
    std::array<std::optional<std::uint32_t>, 4> previous_epochs_{};
    std::size_t next_previous_ = 0;
};

/// The sequences of a noun's updates, for each publisher separately. Beyond the limit, the publisher that has been
/// silent for longest is forgotten.
class publisher_sequences {
  public:
    explicit publisher_sequences(std::size_t most) noexcept : max_entries_(most) {}

    /// The tracker for an update that has arrived from this publisher.
    sequence_tracker& of(std::string_view publisher) {
        auto at = sources_.find(publisher);
        if (at == sources_.end()) {
            if (sources_.size() >= max_entries_) {
                sources_.erase(std::min_element(sources_.begin(), sources_.end(), [](const auto& a, const auto& b) {
                    return a.second.heard < b.second.heard;
                }));
            }
            at = sources_.emplace(std::string{publisher}, source{}).first;
        }
        at->second.heard = ++heard_;
        return at->second.order;
    }
    void forget(std::string_view publisher) {
        if (const auto at = sources_.find(publisher); at != sources_.end()) {
            sources_.erase(at);
        }
    }
    [[nodiscard]] std::size_t size() const noexcept { return sources_.size(); }

  private:
    struct source {
        sequence_tracker order;
        std::uint64_t heard = 0; // when, counted in updates
    };

    std::size_t max_entries_;
    std::map<std::string, source, std::less<>> sources_;
    std::uint64_t heard_ = 0;
};

} // namespace cles::core
