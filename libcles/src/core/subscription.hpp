// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/update_mark.hpp>

#include "core/feed_mailbox.hpp"
#include "core/publisher_orders.hpp"
#include "core/text_map.hpp"
#include "core/update_order.hpp"
#include "protocol/message.hpp"
#include "protocol/update_head.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// What a node is bound to on one link, from the binder's side. Takes updates in, drops what is not wanted or not new.
class subscription {
  public:
    /// `thinned`: with `every`, so that what is missing is no gap. `publishers`: so many are told apart, where it is
    /// all.
    subscription(std::string target, std::string path, bool thinned, std::size_t publishers)
        : target_(std::move(target)), path_(std::move(path)), thinned_(thinned),
          each_(target_ == "all" ? std::make_unique<publisher_orders>(publishers) : nullptr) {}
    subscription(const subscription&) = delete;
    subscription& operator=(const subscription&) = delete;

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    /// With these terms, as any text; one of the same noun and terms may share its binding. Without, none does.
    void share_by(std::string terms) { terms_ = std::move(terms); }
    [[nodiscard]] bool may_share(const subscription& other) const noexcept {
        return !terms_.empty() && terms_ == other.terms_ && target_ == other.target_ && path_ == other.path_;
    }
    /// Others have shared its binding, on the link that it is on or was on last: that may be there although its own
    /// BIND is refused, and after they have gone.
    [[nodiscard]] bool has_shared() const noexcept { return has_shared_; }
    /// Its BIND has been answered: what comes is for it. (For one alone nothing comes before.)
    [[nodiscard]] virtual bool is_bound() const noexcept { return true; }

    /// Hands an update on: first a gap that it shows, then itself. False where it is old or repeated, or its body is
    /// not JSON.
    bool take(const protocol::request_line& update, feed_mailbox::hand_over when = feed_mailbox::hand_over::now);
    /// Updates up to this one are old.
    void skip_to(const update_mark& mark) noexcept { order_.take(mark.epoch, mark.seq); }

  protected:
    ~subscription() = default;

  private:
    friend class subscriptions;

    /// False where the event's body is not JSON.
    virtual bool on_event(const detail::raw_event& event, feed_mailbox::hand_over when) = 0;

    std::string target_;
    std::string path_;
    std::string terms_;
    bool thinned_;
    bool has_shared_ = false;
    update_order order_;
    std::unique_ptr<publisher_orders> each_; // where it is bound to all
};

/// The subscriptions on one link, by what they are bound to: one for each publisher and noun, or several that share
/// their binding.
class subscriptions {
  public:
    /// False where the noun is, or may be, bound on this link already, and that binding cannot be shared.
    bool add(subscription& s);
    [[nodiscard]] bool admits(const subscription& s) const;
    void remove(const subscription& s);
    /// Another one is bound whose binding this one may share.
    [[nodiscard]] bool has_bound_for(const subscription& s) const;
    [[nodiscard]] bool has(std::string_view target, std::string_view path) const;
    /// The subscription that an update is for, or null.
    [[nodiscard]] subscription* find(std::string_view publisher, std::string_view path) const;

    /// An update and whom it is for; `whose` is null where the line is none or nobody wants it.
    struct match {
        const protocol::request_line* update = nullptr;
        subscription* whose = nullptr;
    };
    /// Recognises an update that follows one of the same noun. Valid until the next call.
    [[nodiscard]] match recognise(std::string_view line) noexcept;
    /// Finds whom a parsed update is for, and keeps its head in mind where updates of the noun follow each other.
    [[nodiscard]] match find(std::string_view line, const protocol::request_line& update);
    /// Hands an update to whom it is for, and those who share the binding. False where it is news to none of them.
    bool deliver(const match& found);
    [[nodiscard]] bool empty() const noexcept { return by_path_.empty(); }

  private:
    void forget_last() noexcept;
    [[nodiscard]] const std::vector<subscription*>& all_of(std::string_view path) const;

    // Mostly one node publishes a path on a link, so that a short list is quicker than a second key.
    text_map<std::vector<subscription*>> by_path_;
    std::size_t sharing_ = 0;         // those that share the binding of another
    subscription* last_ = nullptr;    // whom the update before was for
    subscription* head_of_ = nullptr; // whom updates with the head in mind are for
    protocol::update_head head_;
    std::string scratch_;
};

} // namespace cles::core
