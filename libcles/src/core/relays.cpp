// SPDX-License-Identifier: BSL-1.0
#include "core/relays.hpp"

#include "core/refusals.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

class relays::relay final : public feed_events {
  public:
    relay(relays& owner, const std::string& noun)
        : owner_(owner),
          topic_({owner.node_.deadlines, owner.counts_, owner.node_.bounds.binding_bytes, owner.node_.kept_values},
                 noun),
          held_last_(owner.node_.kept_values) {}

    void start(std::string_view node, std::string_view path, std::string_view adverbs) {
        ticket_ = owner_.out_.bind(node, path, adverbs, *this);
    }
    void join(const std::weak_ptr<const void>& whose, told tell) {
        if (bound_) {
            tell(&topic_, last_value(), {});
            return;
        }
        if (waiting_.size() == waiting_.capacity()) { // before there are more: those who have given up
            std::erase_if(waiting_, [](const waiter& w) { return w.whose.expired(); });
        }
        waiting_.push_back({whose, std::move(tell)});
    }

    [[nodiscard]] std::optional<update_mark> mark() const { return fresh_ ? std::nullopt : topic_.last_mark(); }
    [[nodiscard]] topic& subject() noexcept { return topic_; }
    [[nodiscard]] std::uint64_t ticket() const noexcept { return ticket_; }
    [[nodiscard]] bool is_wanted() const noexcept { return topic_.is_bound() || !waiting_.empty() || telling_; }

  private:
    struct waiter {
        std::weak_ptr<const void> whose;
        told tell;
    };

    void on_bound(std::string_view last) override {
        bound_ = true;
        last_ = last;
        fresh_ = last_ != topic_.last_body(); // a node that says which update it is has had it told as one
        held_last_.resize(last_.size());
        telling_ = true;
        for (const auto& w : std::exchange(waiting_, {})) {
            if (!w.whose.expired()) {
                w.tell(&topic_, last_, {});
            }
        }
        telling_ = false;
        if (!fresh_) {
            forget_last();
        }
        if (!is_wanted()) {
            owner_.close(*this);
        }
    }
    void on_refused(const protocol::failure& why) override {
        const auto waiting = std::exchange(waiting_, {});
        const auto held = owner_.all_.extract(topic_.path());
        for (const auto& w : waiting) {
            if (!w.whose.expired()) {
                w.tell(nullptr, {}, why);
            }
        }
    }
    void on_update(std::string_view line, std::string_view body) override {
        topic_.begin().append(line);
        if (!topic_.hold()) { // the newest goes on all the same: nobody would send it again
            topic_.shed();
        }
        forget_last();
        topic_.commit(line.size() - body.size());
        fresh_ = false;
        owner_.mark(topic_);
    }

    void forget_last() noexcept {
        std::string{}.swap(last_);
        held_last_.resize(0);
    }
    /// Of the last update, or of the answer to BIND where that is newer.
    [[nodiscard]] std::string_view last_value() const noexcept { return fresh_ ? last_ : topic_.last_body(); }

    relays& owner_;
    topic topic_;
    std::uint64_t ticket_ = 0;
    bool bound_ = false; // it has been, and will be again
    bool telling_ = false;
    bool fresh_ = false;
    std::string last_;
    memory_reservation held_last_;
    std::vector<waiter> waiting_;
};

relays::relays(node& host, onward& out, std::function<void()> wake) : node_(host), out_(out), wake_(std::move(wake)) {}

relays::~relays() = default;

void relays::join(std::string_view node, std::string_view path, std::string_view adverbs,
                  const std::weak_ptr<const void>& whose, told tell) {
    const auto noun = std::string{node} + ":" + std::string{path};
    auto at = all_.find(noun);
    if (at != all_.end()) {
        at->second->join(whose, std::move(tell));
        return;
    }
    if (all_.size() >= node_.bounds.nouns || stopped_) {
        tell(nullptr, {}, {.code = errc::busy, .message = "as many nouns are passed on as may be"});
        return;
    }
    if (!node_.kept_values->has_room(1)) {
        tell(nullptr, {}, no_memory(node_));
        return;
    }
    at = all_.emplace(noun, std::make_unique<relay>(*this, noun)).first;
    at->second->join(whose, std::move(tell));
    at->second->start(node, path, adverbs);
}

std::optional<update_mark> relays::mark_of(const topic& t) const {
    const auto at = all_.find(t.path());
    return at == all_.end() ? std::nullopt : at->second->mark();
}

topic* relays::find(std::string_view noun) noexcept {
    const auto at = all_.find(noun);
    return at == all_.end() ? nullptr : &at->second->subject();
}

void relays::release(topic& t) {
    const auto at = all_.find(t.path());
    if (at != all_.end() && !at->second->is_wanted()) {
        close(*at->second);
    }
}

void relays::close(relay& r) {
    std::erase(dirty_, &r.subject());
    const auto held = all_.extract(r.subject().path());
    if (!stopped_) {
        out_.unbind(r.ticket());
    }
}

void relays::mark(topic& t) {
    if (t.is_bound() && std::find(dirty_.begin(), dirty_.end(), &t) == dirty_.end()) {
        dirty_.push_back(&t);
        if (dirty_.size() == 1) {
            wake_();
        }
    }
}

void relays::drain(time_point now) {
    for (auto* t : std::exchange(dirty_, {})) {
        t->drain(now);
    }
}

} // namespace cles::core
