// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/update_mark.hpp>

#include "node/base/string_map.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "protocol/request_line.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// Determines from `seq` and `epoch` which updates of a noun are new to a subscriber, and how many it has missed.
class sequence_tracker {
  public:
    /// How many updates are missing between the last one and this one; nothing if this one is old or repeated.
    std::optional<std::uint64_t> take(std::uint32_t epoch, std::uint64_t seq) noexcept;

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
    sequence_tracker& of(std::string_view publisher);
    void forget(std::string_view publisher);
    [[nodiscard]] std::size_t size() const noexcept { return sources_.size(); }

  private:
    struct source {
        sequence_tracker order;
        std::uint64_t last_update = 0; // when, counted in updates
    };

    std::size_t max_entries_;
    std::map<std::string, source, std::less<>> sources_;
    std::uint64_t updates_received_ = 0;
};

/// A node's binding on one link or in the multicast group, at the subscriber. Accepts updates, and drops those that are
/// unwanted or not new.
class subscription {
  public:
    /// `thinned`: bound with `every`, so that missing updates are not a gap. `publishers`: how many of them are tracked
    /// separately if the target is `all`.
    subscription(std::string target, std::string path, bool thinned, std::size_t publishers)
        : target_(std::move(target)), path_(std::move(path)), thinned_(thinned),
          each_(target_ == "all" ? std::make_unique<publisher_sequences>(publishers) : nullptr) {}
    subscription(const subscription&) = delete;
    subscription& operator=(const subscription&) = delete;

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    /// The terms as text: subscriptions with the same noun and terms may share a binding. Without terms, none does.
    void set_sharing_key(std::string terms) { terms_ = std::move(terms); }
    [[nodiscard]] bool may_share(const subscription& other) const noexcept {
        return !terms_.empty() && terms_ == other.terms_ && target_ == other.target_ && path_ == other.path_;
    }
    /// Whether others have shared its binding, on its current or last link. Then the binding may exist even if its own
    /// BIND is refused, and after the others have gone.
    [[nodiscard]] bool has_shared() const noexcept { return has_shared_; }
    /// Whether its BIND has been answered, so that arriving updates are for it. (Unless the binding is shared, none
    /// arrive earlier.)
    [[nodiscard]] virtual bool is_bound() const noexcept { return true; }

    /// Delivers an update, after the gap that it shows. False if it is old or repeated, or its body is not JSON.
    bool take(const protocol::request_line& update, feed_mailbox::hand_over when = feed_mailbox::hand_over::now);
    /// From now on, updates up to this one are old.
    void skip_to(const update_mark& mark) noexcept { order_.take(mark.epoch, mark.seq); }
    /// That node's next update counts as its first.
    void forget(std::string_view publisher);
    /// How many publishers are tracked.
    [[nodiscard]] std::size_t publishers() const noexcept { return each_ ? each_->size() : 1; }

  protected:
    ~subscription() = default;

  private:
    friend class subscriptions;

    /// Returns false if the event's body is not JSON.
    virtual bool on_event(const detail::raw_event& event, feed_mailbox::hand_over when) = 0;

    std::string target_;
    std::string path_;
    std::string terms_;
    bool thinned_;
    bool has_shared_ = false;
    sequence_tracker order_;
    std::unique_ptr<publisher_sequences> each_; // only if the target is `all`
};

/// The subscriptions on one link, by noun: one for each publisher and noun, or several that share a binding.
class subscriptions {
  public:
    /// Returns false if the noun is, or may be, bound on this link already, and that binding cannot be shared.
    [[gnu::cold]] bool add(subscription& s);
    [[nodiscard, gnu::cold]] bool admits(const subscription& s) const;
    [[gnu::cold]] void remove(const subscription& s);
    /// Whether another subscription is bound whose binding this one may share.
    [[nodiscard]] bool has_bound_for(const subscription& s) const;
    [[nodiscard, gnu::cold]] bool has(std::string_view target, std::string_view path) const;
    /// The subscription that an update is for, or null.
    [[nodiscard]] subscription* find(std::string_view publisher, std::string_view path) const;

    /// An update and its subscription. `update` is null if the line was not recognised, `whose` if nobody wants the
    /// update.
    struct match {
        const protocol::request_line* update = nullptr;
        subscription* whose = nullptr;
    };
    /// Recognises an update that follows one of the same noun. The result is valid until the next call.
    [[nodiscard]] match recognise(std::string_view line) noexcept;
    /// Finds the subscription for a parsed update. Remembers the update's head when updates of the noun follow each
    /// other.
    [[nodiscard]] match find(std::string_view line, const protocol::request_line& update);
    /// Delivers an update to its subscription and to those that share the binding. False if it is new to none of them.
    bool deliver(const match& found);
    [[nodiscard]] bool empty() const noexcept { return by_path_.empty(); }

  private:
    void forget_last() noexcept;
    [[nodiscard, gnu::cold]] std::span<subscription* const> all_of(std::string_view path) const;

    // Usually one node publishes a path on a link, so a short list is faster than a second key.
    string_map<std::vector<subscription*>> by_path_;
    std::size_t sharing_ = 0;         // those that share another's binding
    subscription* last_ = nullptr;    // receiver of the previous update
    subscription* head_of_ = nullptr; // receiver of updates with the remembered head
    protocol::update_head head_;
    std::string scratch_;
};

} // namespace cles::core
