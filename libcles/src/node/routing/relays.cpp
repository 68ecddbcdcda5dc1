// SPDX-License-Identifier: BSL-1.0
#include "node/routing/relays.hpp"

#include "node/routing/all_binding.hpp"
#include "node/session/request_checks.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

std::string relayed_path::key(std::string_view node) const {
    auto made = std::string{node}.append(":").append(text);
    if (!by.requester.empty()) {
        made.append(" from=").append(by.requester);
    }
    return made;
}

class relays::relay final : public feed_events {
  public:
    relay(relays& owner, const std::string& noun)
        : owner_(owner),
          topic_({owner.node_.deadlines, owner.counts_, owner.node_.bounds.binding_bytes, owner.node_.kept_values},
                 noun),
          held_last_(owner.node_.kept_values) {}
    ~relay() { owner_.node_.unsent_relayed.forget(topic_); }
    relay(const relay&) = delete;
    relay& operator=(const relay&) = delete;

    void start(const forwarding_permit& permit, std::string_view path) {
        upstream_ = owner_.out_.bind(permit, path, *this);
    }
    void stop() { upstream_.reset(); }
    void join(const std::weak_ptr<const void>& whose, result_callback done) {
        if (denied_) {
            done(nullptr, {}, {}, *denied_);
            return;
        }
        if (bound_) {
            done(&topic_, last_value(), mark(), {});
            return;
        }
        if (waiting_.size() == waiting_.capacity()) { // instead of growing: removes those that have given up
            std::erase_if(waiting_, [](const waiter& w) { return w.whose.expired(); });
        }
        waiting_.push_back({whose, std::move(done)});
    }

    [[nodiscard]] topic& subject() noexcept { return topic_; }
    [[nodiscard]] bool is_wanted() const noexcept { return topic_.is_bound() || !waiting_.empty() || telling_; }

  private:
    struct waiter {
        std::weak_ptr<const void> whose;
        result_callback done;
    };

    void on_bound(std::string_view last) override {
        bound_ = true;
        denied_.reset();
        last_ = last;
        fresh_ = last_ != topic_.last_body(); // a marked last value was already delivered as an update
        held_last_.resize(last_.size());
        telling_ = true;
        for (const auto& w : std::exchange(waiting_, {})) {
            if (!w.whose.expired()) {
                w.done(&topic_, last_, mark(), {});
            }
        }
        telling_ = false;
        if (!fresh_) {
            forget_last();
        }
        if (!is_wanted()) {
            owner_.all_.erase(topic_.path());
        }
    }
    void on_refused(const protocol::failure& why) override {
        const auto waiting = std::exchange(waiting_, {});
        const auto held = owner_.all_.extract(topic_.path());
        for (const auto& w : waiting) {
            if (!w.whose.expired()) {
                w.done(nullptr, {}, {}, why);
            }
        }
    }
    void on_denied(const protocol::failure& why) override {
        denied_ = why;
        topic_.tell_denied();
    }
    void on_update(std::string_view line, std::string_view body) override {
        topic_.begin().append(line);
        if (!topic_.account_memory()) { // the newest is forwarded anyway: it would not be sent again
            topic_.shed();
        }
        forget_last();
        topic_.commit(line.size() - body.size());
        fresh_ = false;
        owner_.node_.unsent_relayed.mark(topic_);
    }

    void forget_last() noexcept {
        std::string{}.swap(last_);
        held_last_.resize(0);
    }
    /// Of the last update, or of the reply to BIND if that is newer.
    [[nodiscard]] std::string_view last_value() const noexcept { return fresh_ ? last_ : topic_.last_body(); }
    /// Which update that is, if it is known.
    [[nodiscard]] std::optional<update_mark> mark() const { return fresh_ ? std::nullopt : topic_.last_mark(); }

    relays& owner_;
    topic topic_;
    std::shared_ptr<void> upstream_;          // its binding at the other node
    bool bound_ = false;                      // it was bound, and will be again if it is lost
    std::optional<protocol::failure> denied_; // since it was bound last
    bool telling_ = false;
    bool fresh_ = false;
    std::string last_;
    memory_reservation held_last_;
    std::vector<waiter> waiting_;
};

relays::relays(node_state& host, next_hop& out) : node_(host), out_(out) {}

relays::~relays() = default;

void relays::stop() {
    stopped_ = true;
    for (const auto& [noun, r] : all_) {
        r->stop();
    }
}

void relays::join(const forwarding_permit& permit, const relayed_path& path, const std::weak_ptr<const void>& whose,
                  result_callback done) {
    const auto noun = path.key(permit.node());
    auto at = all_.find(noun);
    if (at != all_.end()) {
        at->second->join(whose, std::move(done));
        return;
    }
    if (all_.size() >= node_.bounds.nouns || stopped_) {
        done(nullptr, {}, {}, {.code = errc::busy, .message = "the limit of forwarded nouns is reached"});
        return;
    }
    if (!node_.kept_values->has_capacity(1)) {
        done(nullptr, {}, {}, no_memory(node_));
        return;
    }
    at = all_.emplace(noun, std::make_unique<relay>(*this, noun)).first;
    at->second->join(whose, std::move(done));
    at->second->start(permit, path.text);
}

topic* relays::find(std::string_view noun) noexcept {
    const auto at = all_.find(noun);
    return at == all_.end() ? nullptr : &at->second->subject();
}

void relays::release(topic& t) {
    const auto at = all_.find(t.path());
    if (at != all_.end() && !at->second->is_wanted()) {
        all_.erase(at);
    }
}

relayed_bindings::~relayed_bindings() { clear(); }

void relayed_bindings::bind(const forwarding_permit& permit, const relayed_path& path, binding::terms wanted,
                            bool wants_mark, const std::shared_ptr<call>& c) {
    std::erase_if(asking_, [](const asking& a) {
        const auto waits = a.answers.lock();
        return !waits || waits->ended();
    });
    const named noun{path.key(permit.node()), std::string{permit.node()}, path};
    asking_.push_back({noun.key, c});
    from_->join(
        permit, path, c,
        [this, weak = std::weak_ptr{c}, wanted, wants_mark,
         noun](topic* t, std::string_view last, const std::optional<update_mark>& mark, const protocol::failure& why) {
            const auto waits = weak.lock();
            if (!waits || waits->ended()) { // `this` may have been destroyed with its link
                return;
            }
            if (t == nullptr) {
                waits->fail(why);
                return;
            }
            // The right may have ended while the node was found, reached or asked.
            const auto& by = noun.path.by;
            const auto may = may_pass_on(from_->host(), by, noun.node, verb::bind, noun.path.text);
            if (may != passage::permitted) {
                waits->fail(no_passage(from_->host(), may, by, noun.node, verb::bind, noun.path.text));
                return;
            }
            if (!waits->can_answer(last.size())) {
                waits->fail({.code = errc::busy, .message = "no memory is left for the answer (limits.memory)"});
                return;
            }
            // Bound before the reply, which may trigger other requests of the peer; updates follow the reply later.
            bound_.bind(*t, wanted);
            if (!is_by_name(noun.key)) {
                by_name_.push_back(noun);
            }
            if (wants_mark) {
                waits->set_head(protocol::mark_text(mark));
            }
            waits->done(last);
        });
}

bool relayed_bindings::binds(std::string_view target, const relayed_path& path) {
    return target == "all" ? all_.contains(path) : bound_.has(path.key(target));
}

bool relayed_bindings::is_by_name(std::string_view key) const {
    return std::ranges::any_of(by_name_, [key](const named& each) { return each.key == key; });
}

std::vector<std::pair<std::string, relayed_path>> relayed_bindings::forbidden(const node_state& host) const {
    std::vector<std::pair<std::string, relayed_path>> found;
    for (const auto& each : by_name_) {
        if (may_pass_on(host, each.path.by, each.node, verb::bind, each.path.text) != passage::permitted) {
            found.emplace_back(each.node, each.path);
        }
    }
    for (const auto& [path, all] : all_) {
        if (!all->is_permitted()) {
            found.emplace_back("all", path);
        }
    }
    return found;
}

void relayed_bindings::withdraw(std::string_view noun) {
    for (const auto& a : std::vector<asking>{asking_}) {
        if (a.noun != noun) {
            continue;
        }
        if (const auto c = a.answers.lock(); c && !c->ended()) {
            c->fail({.code = errc::cancelled, .message = "it was unbound"});
        }
    }
}

void relayed_bindings::unbind(std::string_view target, const relayed_path& path) {
    if (target == "all") {
        if (const auto held = all_.extract(path); !held.empty()) {
            held.mapped()->close();
        }
        return;
    }
    const auto noun = path.key(target);
    withdraw(noun);
    std::erase_if(by_name_, [&](const named& each) { return each.key == noun; });
    bound_.unbind(noun);
}

void relayed_bindings::clear() {
    for (const auto& [path, all] : std::exchange(all_, {})) {
        all->close();
    }
    by_name_.clear();
    asking_.clear();
    bound_.clear();
}

// -- parts of `all` ------------------------------------------------------------------------------------------------

void relayed_bindings::take_part(topic& t, binding::terms wanted) {
    if (!is_by_name(t.path())) {
        bound_.bind(t, wanted);
    }
}

void relayed_bindings::leave_part(std::string_view noun) {
    if (!is_by_name(noun)) {
        bound_.unbind(noun);
    }
}

topic* relayed_bindings::take_own_part(std::string_view path, binding::terms wanted) {
    if (!published_.can_open(path)) {
        return nullptr;
    }
    auto& t = published_.open(path);
    if (!own_.has(path)) {
        own_by_all_.emplace_back(path);
    }
    if (std::ranges::find(own_by_all_, path) != own_by_all_.end()) {
        own_.bind(t, wanted);
    }
    return &t;
}

void relayed_bindings::leave_own_part(std::string_view path) {
    if (std::erase(own_by_all_, path) != 0) {
        own_.unbind(path);
    }
}

} // namespace cles::core
