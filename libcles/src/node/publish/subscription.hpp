// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/update_mark.hpp>

#include "node/publish/feed_mailbox.hpp"
#include "node/publish/sequence_tracker.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <utility>

namespace cles::core {

/// A node's binding on one link, at the subscriber. Accepts updates, and drops those that are unwanted or not new.
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

} // namespace cles::core
